// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/interrupter.hpp"
#include "fit/model/capture_problem.hpp"
#include "fit/model/predictor.hpp"
#include "job/documents/fit_document.hpp"

namespace matterfit::job {

/// What the fit of one law needs to know.
struct FitSetup {
  const FitDoc* fit = nullptr;
  const fit::Experiment* experiment = nullptr;
  /// One a run: its scene with this law's material.
  std::vector<fit::SceneBuilder> builders;
  material::Law law = material::Law::kFixedCorotated;
  std::vector<fit::ParameterSpec> parameters;
  mpm::SimdTarget target = mpm::SimdTarget::kAuto;
  int threads = 0;
  double memory_limit_gb = 8.0;
};

/// What the fit of one law compares: its scenes at any level with its captures over any window, and
/// by how much they may differ.
class FitProblems {
 public:
  /// Builds the scenes at the document's resolution. Throws Error(kInput), Error(kCancelled).
  FitProblems(FitSetup setup, const Interrupter& interrupter);

  [[nodiscard]] const FitSetup& setup() const { return setup_; }
  [[nodiscard]] const fit::Parameters& parameters() const { return predictor_.parameters(); }
  /// The scenes of the runs at the document's resolution.
  [[nodiscard]] const std::vector<mpm::Scene>& scenes() const { return predictor_.scenes(); }
  [[nodiscard]] const std::vector<fit::Run>& runs() const { return predictor_.runs(); }
  [[nodiscard]] fit::Predictor& predictor() { return predictor_; }
  [[nodiscard]] const fit::Model& model(double level) { return predictor_.model(level); }
  /// The residuals of all used samples at a level.
  [[nodiscard]] fit::CaptureProblem problem(double level, const fit::Window& window,
                                            const std::vector<fit::Parameter>& parameters);
  [[nodiscard]] fit::CaptureProblem problem(double level, const fit::Window& window) {
    return problem(level, window, parameters().parameters());
  }
  /// The mean distance beyond which a start is poor, and that beyond which an end is far off [m].
  [[nodiscard]] double poor() const;
  [[nodiscard]] double far() const;
  /// What clouds of one body miss each other by in the mean [m].
  [[nodiscard]] double alike() const;

 private:
  FitSetup setup_;
  fit::Predictor predictor_;
};

/// The mean of distances; 0 of none.
[[nodiscard]] double mean_value(const std::vector<double>& distances);

}  // namespace matterfit::job
