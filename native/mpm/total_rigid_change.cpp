// SPDX-License-Identifier: GPL-3.0-or-later
// Rigid changes of a total Lagrangian body's motion between two frames.
#include "mpm/total_body.hpp"
#include "mpm/total_stencil.hpp"

namespace matterfit::mpm {

template <class S>
void TotalBody<S>::nudge(const Vec3d& velocity, const Vec3d& spin) {
  Vec3d moment = Vec3d::Zero();
  double mass = 0.0;
  for (std::uint32_t n = 0; n < grid_.mass().size(); ++n) {
    moment += grid_.mass()[n] * (grid_.node_position(n) + field_value(displacement_, n));
    mass += grid_.mass()[n];
  }
  change({.center = grid_.to_world(moment / mass), .velocity = velocity, .spin = spin});
}

template <class S>
void TotalBody<S>::change(const RigidChange& change) {
  const Mat3d& axes = grid_.axes();
  const Vec3d there = change.center + change.shift;
  const bool moves = !change.rotation.isIdentity(0.0) || !change.shift.isZero(0.0);
  for (std::uint32_t n = 0; n < grid_.mass().size(); ++n) {
    const Vec3d rest = grid_.node_position(n);
    Vec3d place = grid_.to_world(rest + field_value(displacement_, n));
    Vec3d velocity = axes * field_value(velocity_, n);
    if (moves) {
      place = there + change.rotation * (place - change.center);
      velocity = change.rotation * velocity;
      set_field_value(displacement_, n, Vec3d(axes.transpose() * (place - grid_.to_world(rest))));
    }
    velocity += change.velocity + change.spin.cross(place - there);
    set_field_value(velocity_, n, Vec3d(axes.transpose() * velocity));
  }
}

template void TotalBody<float>::nudge(const Vec3d&, const Vec3d&);
template void TotalBody<double>::nudge(const Vec3d&, const Vec3d&);
template void TotalBody<float>::change(const RigidChange&);
template void TotalBody<double>::change(const RigidChange&);

}  // namespace matterfit::mpm
