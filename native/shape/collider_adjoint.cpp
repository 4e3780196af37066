// SPDX-License-Identifier: GPL-3.0-or-later
#include "shape/collider_adjoint.hpp"

#include <cmath>

namespace matterfit::shape {

namespace {

/// How a vector changes from `low` over `at` to `high`, which lie `probe` apart. Where it turns
/// sharply to one side only, as a mesh's normal does at an edge, the other side counts.
Vec3d slope(const Vec3d& low, const Vec3d& at, const Vec3d& high, double probe) {
  constexpr double kSharp = 4.0;
  const Vec3d below = at - low;
  const Vec3d above = high - at;
  if (above.norm() > kSharp * below.norm()) return below / probe;
  if (below.norm() > kSharp * above.norm()) return above / probe;
  return (high - low) / (2.0 * probe);
}

}  // namespace

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
      x_bar += size * slope(low.normal, at.normal, high.normal, probe);
    }
  } else {
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3d step = probe * Vec3d::Unit(axis);
      const SurfacePoint high = collider.closest(x + step, time);
      const SurfacePoint low = collider.closest(x - step, time);
      x_bar[axis] += slope(low.normal, at.normal, high.normal, probe).dot(normal_bar) +
                     slope(low.velocity, at.velocity, high.velocity, probe).dot(velocity_bar);
    }
  }
  // A collider that moves by t meets x as it met x − t before; one that turns, x turned back.
  bar.translation -= x_bar;
  bar.rotation += at.normal.cross(normal_bar) + at.velocity.cross(velocity_bar) - x.cross(x_bar);
  return x_bar;
}

}  // namespace matterfit::shape
