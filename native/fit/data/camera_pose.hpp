// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "base/vec.hpp"
#include "splat/camera.hpp"

namespace matterfit::fit {

/// How a camera stands, and what lens it has, against what its file says.
struct CameraPose {
  Vec3d shift = Vec3d::Zero();  ///< of its centre, in the world's axes [m]
  /// Rotation vector of the camera about its centre, in its own axes (x right, y down, z forward)
  /// [rad].
  Vec3d turn = Vec3d::Zero();
  double focal = 0.0;  ///< share by which its focal lengths are longer; above −1
};

/// The camera of a file in that pose: centre c + shift, camera to world R exp([turn]×).
[[nodiscard]] splat::Camera posed(const splat::Camera& camera, const CameraPose& pose);

/// Throws Error(kInput) where there are more poses than cameras.
void check_poses(const std::vector<CameraPose>& poses, std::size_t cameras);
/// Those of a file, the first of them in these poses. Throws as check_poses() does.
[[nodiscard]] std::vector<splat::Camera> posed(std::vector<splat::Camera> cameras,
                                               const std::vector<CameraPose>& poses);

}  // namespace matterfit::fit
