// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/camera_pose.hpp"

#include <Eigen/Geometry>
#include <string>
#include <utility>

#include "base/error.hpp"

namespace matterfit::fit {

splat::Camera posed(const splat::Camera& camera, const CameraPose& pose) {
  splat::Camera result = camera;
  const double angle = pose.turn.norm();
  if (angle > 0.0) {
    const Mat3d turn = Eigen::AngleAxisd(angle, pose.turn / angle).toRotationMatrix();
    result.rotation = turn.transpose() * camera.rotation;
  }
  const Vec3d centre = camera.centre() + pose.shift;
  result.translation = -(result.rotation * centre);
  result.fx *= 1.0 + pose.focal;
  result.fy *= 1.0 + pose.focal;
  return result;
}

void check_poses(const std::vector<CameraPose>& poses, std::size_t cameras) {
  if (poses.size() <= cameras) return;
  throw_input("'poses' has " + std::to_string(poses.size()) + " cameras; there are " +
              std::to_string(cameras) + ", from 0.");
}

std::vector<splat::Camera> posed(std::vector<splat::Camera> cameras,
                                 const std::vector<CameraPose>& poses) {
  check_poses(poses, cameras.size());
  for (std::size_t k = 0; k < poses.size(); ++k) cameras[k] = posed(cameras[k], poses[k]);
  return cameras;
}

}  // namespace matterfit::fit
