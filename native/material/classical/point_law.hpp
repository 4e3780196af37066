// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>

#include "base/vec.hpp"
#include "material/classical/law_constants.hpp"

namespace matterfit::material {

/// What a material point carries from step to step.
struct PointState {
  Mat3d elastic = Mat3d::Identity();  ///< elastic deformation gradient
  double strain = 0.0;                ///< equivalent plastic
  /// F̄ G F̄ᵀ − I of each Maxwell branch as xx, yy, zz, yz, xz, xy
  /// (material/classical/maxwell-inl.hpp).
  std::array<Eigen::Matrix<double, 6, 1>, kMostMaxwellBranches> branches;

  PointState() { branches.fill(Eigen::Matrix<double, 6, 1>::Zero()); }
};

/// A material followed along a prescribed deformation: the laws of the solver's kernels
/// (laws-inl.hpp, maxwell-inl.hpp) at one point, in double. Elasticity, return mapping, damping,
/// viscosity and Maxwell branches. Immutable: safe to use from any thread.
class PointLaw {
 public:
  /// `dt` [s]: how long a step takes.
  PointLaw(const Material& material, double dt);

  /// Kirchhoff stress [Pa] at the end of a step in which F ← `step` F, det `step` > 0; carries
  /// `state` along.
  [[nodiscard]] Mat3d advance(const Mat3d& step, PointState& state) const;

 private:
  LawConstants<double> constants_;
  std::shared_ptr<const PublishedLaw> published_;
  double dt_;
  /// Mean stiffness [Pa] and relaxed share of each Maxwell branch over a step.
  std::array<double, kMostMaxwellBranches> stiffness_{};
  std::array<double, kMostMaxwellBranches> relaxed_{};
};

}  // namespace matterfit::material
