// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "shape/keyed.hpp"

namespace matterfit::shape {

/// A rigid frame at one time and how it moves.
struct RigidState {
  Vec3d position = Vec3d::Zero();
  Mat3d rotation = Mat3d::Identity();
  Vec3d velocity = Vec3d::Zero();  ///< of `position`, world [m/s]
  Vec3d spin = Vec3d::Zero();      ///< angular velocity, world axes [rad/s]

  [[nodiscard]] Vec3d to_local(const Vec3d& world) const {
    return rotation.transpose() * (world - position);
  }
  [[nodiscard]] Vec3d to_world(const Vec3d& local) const { return rotation * local + position; }
  /// Velocity [m/s] of the material point that is at `world` now.
  [[nodiscard]] Vec3d velocity_at(const Vec3d& world) const {
    return velocity + spin.cross(world - position);
  }
};

/// Rigid motion from keyed poses: linear positions, slerped rotations, and their exact time
/// derivative (constant velocity and spin within a segment; at a key, those of the segment that
/// begins there). Step keys, a single key, and times outside the keys do not move.
class RigidMotion {
 public:
  /// Normalises the rotations. Throws Error(kInput) naming `what` for no keys, times that do not
  /// ascend, or a value that is not finite.
  RigidMotion(const std::string& what, Keyed<Pose> poses);

  [[nodiscard]] RigidState at(double time) const;
  [[nodiscard]] bool animated() const { return poses_.animated(); }

 private:
  Keyed<Pose> poses_;
  std::vector<RigidState> starts_;  ///< state at each key
};

}  // namespace matterfit::shape
