// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "diagnose/model.hpp"
#include "fit/model/quantity.hpp"
#include "fit/numerics/parameter.hpp"
#include "job/diagnosis/impacts.hpp"
#include "job/documents/json_reader.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// A parameter about 0 that nobody knows better than to `sigma`, its prior and scale, and that is
/// `most` at most.
[[nodiscard]] fit::Parameter nuisance(std::string name, const char* unit, double sigma,
                                      double most);

/// Gives a scene's colliders the contacts that another solver has, and its first body what is lost
/// in it there (Numerics::contact_stiffness, contact_damping and loss).
void struck_by_another_solver(const diagnose::Numerics& numerics, mpm::Scene& scene);

/// One run of a diagnosis as its contacts are looked at.
struct ContactRun {
  const mpm::Scene* scene = nullptr;
  std::vector<const diagnose::Capture*> captures;
  std::vector<std::size_t> bodies;  ///< of each, into the scene's
};

/// What nobody knows of a body's contact with level grounds and takes along in every refit: how
/// high a ground lies and how stiff its contact is, and after each impact (impacts.hpp) the body's
/// velocity and spin. Nothing where the recordings show no impact.
class ContactNuisances {
 public:
  /// Velocity and spin after an impact.
  static constexpr std::size_t kNumbersOfImpact = 6;

  ContactNuisances() = default;
  /// `grounds`: names of the level grounds. `fitted`: what the fit moves, which is left out here.
  ContactNuisances(const std::vector<ContactRun>& runs, const std::vector<std::string>& grounds,
                   const std::vector<fit::Address>& fitted);

  /// Heights and stiffnesses, then the impacts' numbers; each has a prior about 0 (the scene's
  /// own).
  [[nodiscard]] const std::vector<fit::Parameter>& parameters() const { return parameters_; }
  /// How many of them are of grounds.
  [[nodiscard]] std::size_t of_grounds() const { return of_grounds_; }
  /// Impacts of the captures, run by run, by time; each has six parameters, after the grounds'.
  [[nodiscard]] const std::vector<Impact>& impacts() const { return impacts_; }
  /// Puts what is of grounds into a scene with its materials, before anything that changes its
  /// colliders. `values`: one a parameter.
  void set_grounds(std::span<const double> values, mpm::Scene& scene) const;
  /// Heights and stiffnesses of such a scene's grounds, into a document's scene.
  void write_grounds(const mpm::Scene& scene, Json& document) const;
  /// What a document cannot say: a sentence on what the impacts' numbers come to.
  [[nodiscard]] std::string left_out(std::span<const double> values) const;
  void add_impacts(std::span<const double> values, std::size_t run, mpm::Scene& scene) const;

 private:
  struct Ground {
    std::string name;
    bool height = true;
    bool stiffness = true;
  };
  struct Change {
    Vec3d velocity;  ///< [m/s]
    Vec3d spin;      ///< [rad/s]
  };
  [[nodiscard]] Change change_after(std::span<const double> values, std::size_t impact) const;
  std::vector<Ground> grounds_;
  std::size_t of_grounds_ = 0;
  std::vector<Impact> impacts_;
  std::vector<fit::Parameter> parameters_;
};

}  // namespace matterfit::job
