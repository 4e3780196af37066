// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/camera_pose.hpp"

#include <Eigen/Geometry>

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

}  // namespace matterfit::fit
