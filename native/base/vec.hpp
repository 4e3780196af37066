// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

namespace matterfit {

using Vec3f = Eigen::Vector3f;
using Vec3d = Eigen::Vector3d;
using Vec3i = Eigen::Vector3i;
using Mat3f = Eigen::Matrix3f;
using Mat3d = Eigen::Matrix3d;
using Quatd = Eigen::Quaterniond;
/// Points in metres, Z up, unless a contract says otherwise.
using Points = std::vector<Vec3d>;

}  // namespace matterfit
