// SPDX-License-Identifier: GPL-3.0-or-later
#include "shape/rigid_motion.hpp"

#include <cmath>
#include <cstddef>

#include "base/error.hpp"

namespace matterfit::shape {

RigidMotion::RigidMotion(const std::string& what, Keyed<Pose> poses) : poses_(std::move(poses)) {
  const std::size_t keys = poses_.values.size();
  if (keys == 0 || poses_.times.size() != keys) {
    throw_input(what + ": the transform has " + std::to_string(poses_.times.size()) +
                " times for " + std::to_string(keys) + " poses; give at least one of each.");
  }
  for (std::size_t i = 0; i < keys; ++i) {
    Pose& pose = poses_.values[i];
    if (!pose.position.allFinite() || !pose.rotation.coeffs().allFinite() ||
        !std::isfinite(poses_.times[i])) {
      throw_input(what + ": key " + std::to_string(i) + " of the transform is not finite.");
    }
    if (pose.rotation.norm() < 1e-6) {
      throw_input(what + ": key " + std::to_string(i) +
                  " of the transform has a zero quaternion; no rotation is [1, 0, 0, 0].");
    }
    pose.rotation.normalize();
    if (i > 0 && !(poses_.times[i] > poses_.times[i - 1])) {
      throw_input(what + ": times of the transform's keys must ascend; key " + std::to_string(i) +
                  " does not follow key " + std::to_string(i - 1) + ".");
    }
  }
  starts_.resize(keys);
  for (std::size_t i = 0; i < keys; ++i) {
    RigidState& state = starts_[i];
    const Pose& a = poses_.values[i];
    state.position = a.position;
    state.rotation = a.rotation.toRotationMatrix();
    if (poses_.step || i + 1 == keys) continue;
    const Pose& b = poses_.values[i + 1];
    const double span = poses_.times[i + 1] - poses_.times[i];
    // Eigen's AngleAxis takes the shorter way round, as its slerp does.
    const Eigen::AngleAxisd turn(b.rotation * a.rotation.conjugate());
    state.velocity = (b.position - a.position) / span;
    state.spin = turn.axis() * (turn.angle() / span);
  }
}

RigidState RigidMotion::at(double time) const {
  if (!animated()) return starts_.front();
  const auto after = std::upper_bound(poses_.times.begin(), poses_.times.end(), time);
  if (after == poses_.times.begin()) {
    RigidState held = starts_.front();
    held.velocity.setZero();
    held.spin.setZero();
    return held;
  }
  const auto i = static_cast<std::size_t>(after - poses_.times.begin()) - 1;
  RigidState state = starts_[i];
  if (poses_.step || i + 1 == starts_.size()) return state;
  const double elapsed = time - poses_.times[i];
  if (!state.spin.isZero(0.0)) {
    const double rate = state.spin.norm();
    state.rotation =
        Eigen::AngleAxisd(rate * elapsed, state.spin / rate).toRotationMatrix() * state.rotation;
  }
  state.position += state.velocity * elapsed;
  return state;
}

}  // namespace matterfit::shape
