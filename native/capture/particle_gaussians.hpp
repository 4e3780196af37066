// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "base/vec.hpp"
#include "splat/gaussians.hpp"

namespace matterfit::capture {

/// Particles as opaque Gaussians that the rasteriser draws: standard deviation `size` [m] at rest
/// along each axis, carried along by F (Σ' = F size² Fᵀ), so that a stretched body stays closed.
/// `deformation_gradients` (N) or empty; colours are black. An F that is not finite counts as I.
[[nodiscard]] splat::Gaussians particle_gaussians(std::span<const Vec3f> positions,
                                                  std::span<const Mat3f> deformation_gradients,
                                                  double size);

/// Sets the colour of one Gaussian, its coefficients of band 0 alone: sRGB, 0 to 1.
void set_colour(std::span<float> sh, const Vec3f& colour);

/// Sets the colours of Gaussians of degree 0: sRGB, 0 to 1, one each.
void set_colours(splat::Gaussians& gaussians, std::span<const Vec3f> colours);

}  // namespace matterfit::capture
