// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "base/vec.hpp"
#include "bench/reference_law.hpp"

namespace matterfit::bench {

/// The stranger whose motion the five-material benchmark fits: serial MLS-MPM with APIC transfers
/// in double precision, written for this purpose alone and sharing no code with the solver. It
/// differs in what a fit must not depend on: cubic B-splines (D⁻¹ = 3/dx²) where the solver's are
/// quadratic, a fixed substep, a spacing of its own, one jittered particle a half cell, the elastic
/// left Cauchy–Green tensor as the particle's memory. Every grid node at or below z = 0 holds
/// still, as in PAC-NeRF: bodies come to rest some millimetres above the plane.
///
/// Hu et al. 2018, "A Moving Least Squares Material Point Method", eq. 16–18. Particle velocities
/// stand half a substep before positions, so that free flight is exact.
class ReferenceMpm {
 public:
  struct Options {
    double dx = 0.016;       ///< [m]
    double dt = 1e-4;        ///< [s]
    double gravity = -9.81;  ///< along z [m/s²]
    double density = 1000;   ///< [kg/m³]
    bool ground = true;
  };
  struct Particle {
    Vec3d x;
    Vec3d v;
    Mat3d C = Mat3d::Zero();  ///< affine velocity [1/s]
    ReferenceState state;
  };

  /// Particles at rest at `positions` [m], each of the volume (dx/2)³, thrown with `velocity` [m/s]
  /// and `spin` [rad/s] about their mean.
  ReferenceMpm(const std::vector<Vec3d>& positions, const Vec3d& velocity, const Vec3d& spin,
               const ReferenceMaterial& material, const Options& options);

  /// One substep. Throws Error(kCompute) if a particle moves farther than a cell.
  void step();
  [[nodiscard]] const std::vector<Particle>& particles() const { return particles_; }

 private:
  struct Stencil;
  using Node = Eigen::Array4d;  ///< momentum, later velocity; mass

  void fit_grid();
  [[nodiscard]] Stencil stencil(const Vec3d& x) const;
  void scatter();
  void update_grid();
  void gather();

  std::vector<Particle> particles_;
  ReferenceMaterial material_;
  Options options_;
  double volume_;
  Eigen::Vector3i low_ = Eigen::Vector3i::Zero();   ///< the grid's first node, in cells
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();  ///< nodes along each axis
  std::vector<Node> grid_;
};

}  // namespace matterfit::bench
