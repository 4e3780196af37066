// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/parallel.hpp"
#include "splat/rasteriser.hpp"

namespace matterfit::splat {

/// Throw Error(kInput), with what is wrong and where.
void check_camera(const Camera& camera, const RenderOptions& options);
void check_gaussians(const Gaussians& gaussians, Arena& arena);
void check_loss_gradient(const Image& loss_gradient, int width, int height, Arena& arena);

}  // namespace matterfit::splat
