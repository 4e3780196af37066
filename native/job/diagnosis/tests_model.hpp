// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "diagnose/model.hpp"
#include "effects/effect.hpp"
#include "job/documents/document.hpp"
#include "job/documents/tests_document.hpp"
#include "material/material.hpp"

namespace matterfit::job {

/// What a testing machine holds and how it reads, as causes change it.
struct Specimen {
  material::Material material;
  std::vector<effects::Effect> effects;
  double gauge = 1.0;               ///< true over read elongation
  std::vector<double> load_factor;  ///< read over true force, one a test and one that is right
  std::vector<double> load_zero;    ///< what is read without force, nominal [Pa], likewise
};

/// Tests of a testing machine for the discrepancy engine: a law at one material point, its Young's
/// modulus fitted, exact (no solver's error). A test is a capture of one track whose first
/// coordinate is the nominal stress over the measured one and half of the test's mean, so that
/// errors are shares of a stress; frames are the readings by their stretch.
class TestsModel final : public diagnose::Model {
 public:
  /// Throws Error(kInput) where a test has too few readings.
  TestsModel(const TestsDoc& doc, int threads, const Interrupter& interrupter);
  ~TestsModel() override;
  TestsModel(const TestsModel&) = delete;
  TestsModel& operator=(const TestsModel&) = delete;

  [[nodiscard]] diagnose::Shown shown() const override { return {"%", 100.0}; }
  [[nodiscard]] const std::vector<diagnose::Capture>& captures() const override {
    return captures_;
  }
  [[nodiscard]] const std::vector<fit::Parameter>& parameters() const override {
    return parameters_;
  }
  [[nodiscard]] const std::vector<diagnose::Effect>& effects() const override { return effects_; }
  [[nodiscard]] std::vector<std::optional<diagnose::Motion>> simulate(
      const std::vector<diagnose::Point>& points) const override;
  [[nodiscard]] bool has_numerics() const override { return false; }
  [[nodiscard]] std::vector<diagnose::Experiment> experiments() const override;
  [[nodiscard]] std::vector<std::optional<diagnose::Motion>> simulate_experiment(
      int experiment, const std::vector<diagnose::Point>& points) const override;

  /// The specimen at a point of the engine.
  [[nodiscard]] Specimen specimen(const diagnose::Point& point) const;

 private:
  struct Test;
  using Apply = std::function<void(std::span<const double> values, int variant, Specimen&)>;

  void add_test(const material::MachineTest& test, bool held_out);
  void hold_back_ends();
  void add_experiments();
  diagnose::Effect& add(std::string name, const char* group, std::string sentence, Apply apply);
  void add_causes();
  void add_readings();
  [[nodiscard]] std::optional<diagnose::Motion> pull(const Specimen& specimen,
                                                     const std::vector<Test>& tests) const;
  [[nodiscard]] std::vector<std::optional<diagnose::Motion>> pull_all(
      const std::vector<diagnose::Point>& points, const std::vector<Test>& tests) const;

  const Interrupter& interrupter_;
  mutable Arena arena_;
  double noise_;
  material::Material material_;
  std::vector<Test> tests_;
  std::vector<Test> further_;  ///< of experiments()
  std::vector<diagnose::Capture> captures_;
  std::vector<fit::Parameter> parameters_;
  std::vector<diagnose::Effect> effects_;
  std::vector<Apply> apply_;
};

}  // namespace matterfit::job
