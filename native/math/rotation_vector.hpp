// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>

#include "base/vec.hpp"

namespace matterfit {

/// The rotation by `turn`'s length [rad] about its direction: exp of its cross product matrix.
[[nodiscard]] inline Mat3d rotation_by(const Vec3d& turn) {
  const double angle = turn.norm();
  if (angle == 0.0) return Mat3d::Identity();
  return Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
}

}  // namespace matterfit
