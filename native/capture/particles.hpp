// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <string>

#include "base/vec.hpp"
#include "mpm/scene.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::capture {

/// What the caches need to know of one body at one frame. The spans are borrowed and of one length
/// N; velocities and deformation gradients may be empty (at rest, undeformed).
struct ParticleView {
  std::string name;                              ///< of the body, for messages
  std::span<const Vec3f> positions;              ///< (N) world [m]
  std::span<const Vec3f> velocities;             ///< (N) world [m/s], or empty
  std::span<const Mat3f> deformation_gradients;  ///< (N) F, or empty
  std::span<const double> volumes;               ///< (N) at rest [m³]
  double separation = 0.0;                       ///< particle separation h at rest [m]
  Quatd axes = Quatd::Identity();                ///< of the rest lattice

  [[nodiscard]] std::size_t size() const { return positions.size(); }
};

/// Whether F says how the shapes of a body's particles change; F of what flows is not how they
/// moved.
[[nodiscard]] bool carries_shape(const mpm::Body& body);

/// View of `state`, a state of `body`; `separation` h = dx / 2. Throws Error(kInput) if the lengths
/// differ and Error(kCompute) naming the particle if a position, velocity or F is not finite.
[[nodiscard]] ParticleView particle_view(const mpm::Body& body, const mpm::BodyState& state,
                                         double separation);

/// The same checks for a view made by hand.
void check(const ParticleView& view);

/// Principal stretches (descending, the sign of det F on the smallest) and axes of F = U Σ Vᵀ with
/// U and V proper rotations.
struct Stretch {
  Mat3d axes;       ///< U: principal axes in the world
  Vec3d stretches;  ///< Σ
  Mat3d rest_axes;  ///< V
};
[[nodiscard]] Stretch principal_stretches(const Mat3d& deformation_gradient);

/// The rotation R of the polar decomposition F = R S with det R = +1 (also for inverted F).
[[nodiscard]] Mat3d polar_rotation(const Mat3d& deformation_gradient);
/// Its transpose, for rotations dR = [ω]× R: F̄ of what has the cotangent ω̄ in ω. With θ = Rᵀ ω,
/// (tr S I − S) θ = axial(Rᵀ dF − dFᵀ R). Zero where no rotation is nearest: S has two stretches
/// whose sum is nearly 0.
[[nodiscard]] Mat3d polar_rotation_adjoint(const Mat3d& deformation_gradient,
                                           const Vec3d& rotation_bar);

}  // namespace matterfit::capture
