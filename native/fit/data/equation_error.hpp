// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "base/parallel.hpp"
#include "fit/data/track_motion.hpp"
#include "material/material.hpp"

namespace matterfit::fit {

/// How far a place is from where forces act that are not known: colliders, walls, pins.
struct Clearance {
  double distance = 1e30;         ///< [m], negative inside
  Vec3d normal = Vec3d::UnitZ();  ///< unit, away from it
  bool at_rest = false;           ///< both are of the body at rest, not of that time
};

/// A body whose momentum balance is looked at.
struct Balance {
  InteriorTracks tracks;
  Points places;                ///< (Q) its particles at rest
  std::vector<double> volumes;  ///< (Q) at rest [m³]
  double density = 1000.0;      ///< at rest [kg/m³]
  std::vector<Vec3d> gravity;   ///< (T) [m/s²]
  bool flows = false;           ///< see track_motion()
  double contact_reach = 0.0;   ///< unknown forces act so far off what they come from [m]
  /// The least clearance of a place, by its rest position and where it is at a time [s]; empty:
  /// nothing is near. Called from any thread.
  std::function<Clearance(const Vec3d& rest, const Vec3d& position, double time)> clearance;
};

/// What is left of the weak momentum balance in space and time when a material is put into the
/// motion that was captured; no simulation. For a virtual field w(X) and a hat φ(t)
///   Σ V [ρ w · (⟨ẍ⟩ − ⟨g⟩) + ⟨P⟩ : ∂w/∂X] = 0,   P = τ F⁻ᵀ,   ⟨f⟩ = ∫ φ f dt / ∫ φ dt,
/// the sum over the body's particles (virtual fields method: Pierron and Grédiac 2012; on splines,
/// for laws that are sought: EUCLID, Flaschel et al. 2021). ⟨ẍ⟩ is an exact second difference; F
/// between frames is a cubic, so stresses that ring faster than the frames are not resolved.
/// Histories are integrated along it by the solver's own laws (material/classical/point_law.hpp).
///
/// The fields are frozen in the body at the hat's centre: quadratic B-splines N of a grid in space,
/// a cell 1½ track spacings wide, times a ramp s that is 0 where unknown forces act at a frame of
/// the hat. Two families: s N eᵢ, and ∇(s² N) × eᵢ, free of divergence, so that pressure, which the
/// noisy volume of a stiff body does not determine, has no part in it (only the deviator counts
/// there).
///
/// Residuals are divided by their standard deviation at these very parameters: what noise makes of
/// them, through accelerations and stresses, from repeats with as much noise again (effective
/// variance, as in Deming's regression: fixed weights take noise of F for softness); and, for what
/// the frames do not resolve, a share of the stress's own root mean square over the hat.
class EquationError {
 public:
  /// Throws Error(kInput), a sentence, where it does not apply: too few frames or tracks, tracks
  /// not all through the body, too few test functions clear of unknown forces.
  EquationError(Balance balance, Arena& arena);
  ~EquationError();
  EquationError(EquationError&&) noexcept;
  EquationError(const EquationError&) = delete;
  EquationError& operator=(const EquationError&) = delete;

  /// Six a test function.
  [[nodiscard]] std::size_t rows() const { return 6 * tests_; }
  /// Test functions (nodes in space × hats in time) that are used.
  [[nodiscard]] std::size_t tests() const { return tests_; }
  /// Residuals over their standard deviation; the same for any number of threads.
  [[nodiscard]] Eigen::VectorXd evaluate(const material::Material& material, Arena& arena) const;
  /// Minus twice the logarithm of the likelihood, but for a constant, by residual: the mean of
  /// their squares and of the logarithms of their variances. Stiff materials have residuals that
  /// are known badly, so that the squares alone do not compare different materials.
  [[nodiscard]] double deviance(const material::Material& material, Arena& arena) const;

 private:
  struct HatNodes;
  struct Ramp;
  struct MeanStress;
  /// Residuals and their variances.
  struct Weighed {
    Eigen::VectorXd residual;
    Eigen::VectorXd variance;
  };
  [[nodiscard]] Weighed weighed(const material::Material& material, Arena& arena) const;
  void choose_hats();
  void find_ramps(const TrackMotion& motion, Arena& arena);
  void check_cover() const;
  void choose_tests();
  [[nodiscard]] bool known(const TrackMotion& motion, std::size_t hat, std::size_t place) const;
  void follow(const material::Material& material, const TrackMotion& motion, std::size_t place,
              std::vector<MeanStress>& stress) const;
  /// The balance of the captured motion (0) or of a repeat. `material` null: without stress.
  [[nodiscard]] Eigen::VectorXd balance_of(const material::Material* material, std::size_t motion,
                                           Arena& arena) const;
  void add_hat(std::size_t hat, std::size_t motion, const std::vector<MeanStress>& stress,
               Eigen::VectorXd& sums) const;

  Balance balance_;
  double dt_ = 0.0;  ///< between frames [s]
  double cell_ = 0.0;
  std::size_t substeps_ = 1;  ///< between frames
  std::vector<Hat> hats_;
  std::vector<TrackMotion> motions_;      ///< the captured one, then repeats with more noise
  std::vector<std::vector<Ramp>> ramps_;  ///< of each motion (hats, Q)
  std::vector<HatNodes> nodes_;
  std::size_t tests_ = 0;
  Eigen::VectorXd inertia_;  ///< of the captured motion, without stress
  Eigen::VectorXd floor_;    ///< standard deviation of what the scheme itself misses
};

}  // namespace matterfit::fit
