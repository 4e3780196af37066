// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "capture/particles.hpp"

namespace matterfit::capture {

/// How a binding continues the motion from a particle to a point beside it.
enum class BindingGradient {
  /// x(X) = Σ w_p [x_p + F_p (X − X_p)]: F is the gradient of the motion. For elastic bodies.
  kParticle,
  /// Moving least squares: the affine map that fits x_p over X_p best under the weights w_p
  /// (Lancaster & Salkauskas 1981). For flows and plastic bodies, whose F is the elastic part only.
  /// Points whose particles lie in a plane or too far to one side fall back to kParticle.
  kFitted,
};

/// The one that a body's points follow: its F is the gradient of the whole motion for elastic laws.
[[nodiscard]] BindingGradient binding_gradient(const mpm::Body& body);

struct BindingOptions {
  double radius = 2.0;          ///< of the kernel, in particle separations
  std::size_t neighbours = 64;  ///< at most, the nearest
  BindingGradient gradient = BindingGradient::kParticle;
  const Interrupter* interrupter = nullptr;  ///< asked meanwhile, if given: Error(kCancelled)
};

/// Binds points X (vertices of render meshes, markers, splats; inside, on or outside the body) to
/// the rest particles X_p of a body. Weights w_p = (1 − |X − X_p|²/R²)³ over their sum: a smooth
/// partition of unity that reproduces affine motions exactly in either mode. R is
/// radius·h, but never less than the nearest particle's distance + 2 h, so that every point has
/// particles, and shrinks where there would be more than `neighbours`; it varies continuously with
/// X. Deterministic; evaluation runs over points, so bits do not depend on the number of threads.
class MeshBinding {
 public:
  /// `points` and `rest` [m] in the frame of the body at rest. Throws Error(kInput) if there are no
  /// particles, or if a point is not finite.
  MeshBinding(std::span<const Vec3d> points, std::span<const Vec3d> rest, double separation,
              const BindingOptions& options, Arena& arena);

  [[nodiscard]] std::size_t points() const { return points_.size(); }
  [[nodiscard]] std::size_t particles() const { return rest_.size(); }

  /// The point farthest from its nearest particle; a large distance means the mesh and the body do
  /// not belong together.
  struct Farthest {
    std::size_t point = 0;
    double distance = 0.0;  ///< [m]
  };
  [[nodiscard]] Farthest farthest() const { return farthest_; }
  /// Points that are farther than `distance` from their nearest particle.
  [[nodiscard]] std::size_t count_beyond(double distance) const;

  // Each throws Error(kInput) if `state` is not of as many particles.
  [[nodiscard]] std::vector<Vec3d> positions(const ParticleView& state, Arena& arena) const;
  /// The same of particles that were not rounded; `deformation_gradients` empty: undeformed.
  [[nodiscard]] std::vector<Vec3d> positions(std::span<const Vec3d> particles,
                                             std::span<const Mat3d> deformation_gradients,
                                             Arena& arena) const;
  /// [m/s]; exact for affine velocity fields except at the points that fall back (then Σ w_p v_p).
  [[nodiscard]] std::vector<Vec3d> velocities(const ParticleView& state, Arena& arena) const;
  [[nodiscard]] std::vector<Vec3d> velocities(std::span<const Vec3d> particles, Arena& arena) const;
  /// F at the points: Σ w_p F_p, or the fitted gradient.
  [[nodiscard]] std::vector<Mat3d> deformation_gradients(const ParticleView& state,
                                                         Arena& arena) const;

  /// Rest particles and weights of one point, for those who need the transpose (gradients of a
  /// fit): positions are Σ w_p (x_p + F_p (X − X_p)) or Σ fitted_p x_p.
  struct Stencil {
    std::span<const std::uint32_t> particles;  ///< ascending
    std::span<const float> weights;            ///< w_p, sum 1
    std::span<const float> fitted;             ///< sum 1, Σ fitted_p X_p = X; empty: falls back
  };
  [[nodiscard]] Stencil stencil(std::size_t point) const;
  /// The transpose of positions(): adds the cotangents of the points' positions, one each, to those
  /// of the particles' positions and, where it is not empty, deformation gradients. Throws
  /// Error(kInput) if they are of other numbers.
  void spread(std::span<const Vec3d> position_bar, std::span<Vec3d> particle_bar,
              std::span<Mat3d> deformation_gradient_bar) const;
  /// The transpose of deformation_gradients(): adds the cotangents of F at the points, one each, to
  /// those of the particles' positions and deformation gradients, one each too. Throws
  /// Error(kInput) if they are of other numbers.
  void spread_gradients(std::span<const Mat3d> gradient_bar, std::span<Vec3d> particle_bar,
                        std::span<Mat3d> deformation_gradient_bar) const;
  [[nodiscard]] BindingGradient gradient() const { return gradient_; }

 private:
  [[nodiscard]] Mat3d fitted_gradient(std::size_t point, const ParticleView& state) const;
  /// G_p of a point's fitted F = Σ x_p G_pᵀ, one for each particle of its stencil.
  [[nodiscard]] std::vector<Vec3d> gradient_weights(std::size_t point) const;
  void check_size(std::size_t particles, const std::string& name) const;
  void check_bars(std::size_t of_points, std::size_t of_particles, std::size_t of_gradients) const;
  template <class Vector, class Matrix>
  [[nodiscard]] std::vector<Vec3d> moved(std::span<const Vector> positions,
                                         std::span<const Matrix> deformation_gradients,
                                         Arena& arena) const;
  template <class Vector>
  [[nodiscard]] std::vector<Vec3d> speeds(std::span<const Vector> velocities, Arena& arena) const;

  BindingGradient gradient_;
  std::vector<Vec3d> points_;
  std::vector<Vec3d> rest_;
  std::vector<std::size_t> first_;  ///< of each point's neighbours, and the end
  std::vector<std::uint32_t> neighbours_;
  std::vector<float> weights_;
  std::vector<float> fitted_;
  std::vector<std::uint8_t> has_fit_;  ///< one a point
  std::vector<float> nearest_;         ///< distance of the nearest particle, one a point [m]
  Farthest farthest_;
};

/// World positions into the local space of an object whose matrix maps local to world (render
/// meshes' PC2 is in local space), rounded to float.
[[nodiscard]] std::vector<Vec3f> to_local(std::span<const Vec3d> world,
                                          const Eigen::Affine3d& object_to_world);

}  // namespace matterfit::capture
