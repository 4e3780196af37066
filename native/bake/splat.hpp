// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>

#include "base/parallel.hpp"
#include "capture/binding.hpp"
#include "capture/splats.hpp"

namespace matterfit::bake {

struct SplatOptions {
  /// A moved Gaussian longer than this many times its second axis (and than it was at rest) is
  /// shortened to it and counted: such needles show as spikes.
  double needle_ratio = 10.0;
};

struct SplatReport {
  std::size_t needles = 0;  ///< Gaussians that were shortened
};

/// Gaussians carried along by a body: means by the binding, covariance Σ' = F Σ Fᵀ (PhysGaussian,
/// Xie et al. 2024) with F at the mean, spherical harmonics turned by R of F = R S. The axes of Σ'
/// come from one-sided Jacobi rotations of F R₀ S₀ that start at R R₀, so that under a pure
/// rotation the rotation is exactly R R₀ with the scales kept in their order, axes do not jump from
/// frame to frame, and the handedness stays. Isotropic splats become anisotropic. Opacities stay.
/// `binding` is of rest.means. Throws Error(kInput) if it has another number of points, or as the
/// binding does.
[[nodiscard]] capture::Splats transport(const capture::Splats& rest,
                                        const capture::MeshBinding& binding,
                                        const capture::ParticleView& state,
                                        const SplatOptions& options, Arena& arena,
                                        SplatReport* report = nullptr);

/// Rotation and scales of F Σ Fᵀ for Σ = R₀ diag(s₀)² R₀ᵀ; `polar` is R of F = R S.
struct Ellipsoid {
  Mat3d rotation;
  Vec3d scales;
};
[[nodiscard]] Ellipsoid transport_covariance(const Mat3d& deformation_gradient, const Mat3d& polar,
                                             const Mat3d& rotation, const Vec3d& scales);

/// transport() of one frame, written as a 3DGS PLY (capture/splats.hpp). Throws Error(kOutput) too.
SplatReport write_splat_frame(const std::filesystem::path& path, const capture::Splats& rest,
                              const capture::MeshBinding& binding,
                              const capture::ParticleView& state, const SplatOptions& options,
                              Arena& arena);

}  // namespace matterfit::bake
