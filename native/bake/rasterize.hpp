// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <openvdb/openvdb.h>

#include <span>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "capture/particles.hpp"

namespace matterfit::bake {

/// Particles spread to voxels by kernels that deform with the material. Each kernel is the tensor
/// product of quadratic B-splines b over the rest lattice (axes A, spacing h), carried along by the
/// particle's deformation gradient F:
///
///   y = Aᵀ F⁻¹ (x − x_p) / h,   W_p(x) = V_p / h³ · b(y₁) b(y₂) b(y₃).
///
/// Quadratic B-splines on a lattice sum to one, so Σ W_p = 1 inside a lattice under any affine
/// motion and ½ on the outer faces of its cells: the "color field" whose ½-contour is the surface.
/// This is the anisotropic kernel of Yu & Turk 2013 ("Reconstructing surfaces of particle-based
/// fluids using anisotropic kernels") with the axes from F in place of the covariance of the
/// neighbours. The principal stretches used are clamped to [1/kStretchLimit, kStretchLimit].
/// Kernels of a material whose F is not the gradient of the whole motion (a plastic one's is the
/// elastic part) stay nearly round, and material thinned below one particle has holes, which
/// `droplets` closes at each particle; `flows` takes centres and stretches from the neighbours
/// instead (flow_kernels.hpp), with Σ W_p = 1 in the bulk only nearly.
inline constexpr double kStretchLimit = 5.0;

struct RasterOptions {
  double voxel_size = 0.01;  ///< [m]
  bool colour = false;       ///< Σ W_p, with droplets
  bool density = false;      ///< Σ W_p / det F: density over rest density, 1 in undeformed bulk
  bool velocity = false;     ///< Σ W_p/det F v_p / Σ W_p/det F [m/s]
  /// Colour is at least that of an ellipsoid of the particle's own size, a sphere of diameter (V)^⅓
  /// stretched as its kernel is (by F, or with `flows` by the neighbours'), so that single
  /// particles and sheets one particle thick are seen.
  bool droplets = true;
  bool flows = false;  ///< kernels of flow_kernels.hpp: for a surface, not for what conserves mass
};

struct Raster {
  openvdb::FloatGrid::Ptr colour;
  openvdb::FloatGrid::Ptr density;
  openvdb::Vec3SGrid::Ptr velocity;
};

/// The fields asked for, active where a kernel reaches, world space, voxel centres at multiples of
/// the voxel size. Every voxel sums its particles in their order, so the bits do not depend on the
/// number of threads. Throws Error(kInput) if the voxel size is not positive, or so small that the
/// kernels cover more than 2³⁴ voxels, or if coordinates leave the 32-bit index range.
[[nodiscard]] Raster rasterize(std::span<const capture::ParticleView> bodies,
                               const RasterOptions& options, Arena& arena,
                               const Interrupter& interrupter);

}  // namespace matterfit::bake
