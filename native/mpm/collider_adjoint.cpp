// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/collider_adjoint.hpp"

namespace matterfit::mpm {

ColliderCotangents& ColliderCotangents::operator+=(const ColliderCotangents& other) {
  mu += other.mu;
  stiffness += other.stiffness;
  damping += other.damping;
  translation += other.translation;
  rotation += other.rotation;
  return *this;
}

Vec3d back_to_surface(const Collider& collider, const Vec3d& x, double time, double probe,
                      const SurfacePoint& at, double distance_bar, const Vec3d& normal_bar,
                      const Vec3d& velocity_bar, ColliderCotangents& bar) {
  Vec3d x_bar = distance_bar * at.normal;
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d step = Vec3d::Zero();
    step[axis] = probe;
    const SurfacePoint high = collider.closest(x + step, time);
    const SurfacePoint low = collider.closest(x - step, time);
    x_bar[axis] += (high.normal - low.normal).dot(normal_bar) / (2.0 * probe) +
                   (high.velocity - low.velocity).dot(velocity_bar) / (2.0 * probe);
  }
  // A collider that moves by t meets x as it met x − t before; one that turns, x turned back.
  bar.translation -= x_bar;
  bar.rotation += at.normal.cross(normal_bar) + at.velocity.cross(velocity_bar) - x.cross(x_bar);
  return x_bar;
}

}  // namespace matterfit::mpm
