// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/vec.hpp"

namespace matterfit::mpm {

/// A rigid change of a body's motion between two frames: x' = center + rotation (x − center) +
/// shift, velocities turned along, and then the rigid velocity field of `velocity` and `spin`
/// about center + shift added to them. World axes.
struct RigidChange {
  Vec3d center = Vec3d::Zero();  ///< [m]
  Mat3d rotation = Mat3d::Identity();
  Vec3d shift = Vec3d::Zero();     ///< [m]
  Vec3d velocity = Vec3d::Zero();  ///< [m/s]
  Vec3d spin = Vec3d::Zero();      ///< [rad/s]
};

}  // namespace matterfit::mpm
