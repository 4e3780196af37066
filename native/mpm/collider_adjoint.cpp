// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/collider_adjoint.hpp"

#include <cmath>

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
  const bool still = !collider.animated() || velocity_bar.isZero(0.0);
  const double size = normal_bar.norm();
  if (still && std::isinf(collider.band())) {
    // The slope of an exact distance's normal is its Hessian, symmetric: along the cotangent.
    if (size > 0.0) {
      const Vec3d step = probe / size * normal_bar;
      const SurfacePoint high = collider.closest(x + step, time);
      const SurfacePoint low = collider.closest(x - step, time);
      x_bar += size / (2.0 * probe) * (high.normal - low.normal);
    }
  } else {
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3d step = probe * Vec3d::Unit(axis);
      const SurfacePoint high = collider.closest(x + step, time);
      const SurfacePoint low = collider.closest(x - step, time);
      x_bar[axis] += ((high.normal - low.normal).dot(normal_bar) +
                      (high.velocity - low.velocity).dot(velocity_bar)) /
                     (2.0 * probe);
    }
  }
  // A collider that moves by t meets x as it met x − t before; one that turns, x turned back.
  bar.translation -= x_bar;
  bar.rotation += at.normal.cross(normal_bar) + at.velocity.cross(velocity_bar) - x.cross(x_bar);
  return x_bar;
}

}  // namespace matterfit::mpm
