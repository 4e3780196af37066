// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "mpm/scene.hpp"
#include "splat/camera.hpp"
#include "splat/rasteriser.hpp"

namespace matterfit::fit {

/// How much of what was drawn in each pixel no collider stands before, 0 to 1 (a row-major image;
/// empty: all of it everywhere). A collider hides what it meets on the pixel's ray two particle
/// separations or more before the mean depth of what was drawn there, which lies outside of it; one
/// in which the camera stands, as below a ground or outside of a container, is looked through. By
/// sphere tracing (Hart 1996), with four rays a pixel at the edges of what is hidden. `shift`: of
/// the scene against the camera's world [m]; `time` [s after the scene's first frame].
[[nodiscard]] std::vector<float> visible_share(const mpm::Scene& scene, double time,
                                               const Vec3d& shift, const splat::Camera& camera,
                                               const splat::Image& drawn, Arena& arena);

}  // namespace matterfit::fit
