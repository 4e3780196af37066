// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "capture/binding.hpp"
#include "capture/particles.hpp"
#include "capture/splats.hpp"
#include "mpm/scene.hpp"
#include "splat/gaussians.hpp"

namespace matterfit::capture {

/// Splats under x ↦ rotation (scale x) + position, their spherical harmonics turned too.
[[nodiscard]] Splats placed(Splats splats, const Vec3d& position, const Quatd& rotation,
                            double scale);

/// Turns the spherical harmonics of one splat or Gaussian, (degree + 1)² × 3, as a body turns that
/// carries it: by the rotation `polar` of its F there.
void carry_colours(std::span<float> sh, int degree, const Mat3d& polar);

/// Gaussians that a body carries along: means by a binding, the covariance by F at the mean
/// (PhysGaussian, Xie et al. 2024), spherical harmonics by the rotation of F. Immutable: safe to
/// use from any thread.
class CarriedSplats {
 public:
  /// `rest` where the body starts, as its particles do. Throws as MeshBinding does.
  CarriedSplats(Splats rest, const mpm::Body& body, double separation, Arena& arena,
                const Interrupter* interrupter = nullptr);

  [[nodiscard]] const Splats& rest() const { return rest_; }
  [[nodiscard]] const MeshBinding& binding() const { return binding_; }
  [[nodiscard]] std::size_t size() const { return rest_.size(); }
  /// As the rasteriser draws them at a state of the body: Σ' = F Σ Fᵀ is left to it. An F that is
  /// not finite counts as I.
  [[nodiscard]] splat::Gaussians at(const ParticleView& state, Arena& arena) const;
  /// The transpose of at() at `state`: adds the cotangents of its Gaussians, which lie at `first`
  /// among those of `bar`, to the cotangents of the particles' positions and deformation gradients,
  /// one each. Those of their harmonics, which are of `sh_degree`, count if it is given.
  void add_bars(const ParticleView& state, const splat::GaussianGradients& bar, std::size_t first,
                std::optional<int> sh_degree, std::span<Vec3d> particle_bar,
                std::span<Mat3d> deformation_gradient_bar, Arena& arena) const;

 private:
  Splats rest_;
  MeshBinding binding_;
};

}  // namespace matterfit::capture
