// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/vec.hpp"
#include "shape/collider.hpp"

namespace matterfit::shape {

/// Derivatives with respect to a collider's contact and place.
struct ColliderCotangents {
  double mu = 0.0;
  double stiffness = 0.0;             ///< the resolved one [Pa/m]
  double damping = 0.0;               ///< fraction of critical
  Vec3d translation = Vec3d::Zero();  ///< of the whole collider, world axes [m]
  Vec3d rotation = Vec3d::Zero();     ///< of it about the world's origin [rad]

  ColliderCotangents& operator+=(const ColliderCotangents& other);
};

/// The cotangents of distance, normal and velocity of the surface `at` met at `x`: returns that of
/// x, and adds to those of the collider's place. How normal and velocity change from place to place
/// is taken from differences of the exact distance, `probe` [m] to each side, or to the smooth side
/// of an edge.
Vec3d back_to_surface(const Collider& collider, const Vec3d& x, double time, double probe,
                      const SurfacePoint& at, double distance_bar, const Vec3d& normal_bar,
                      const Vec3d& velocity_bar, ColliderCotangents& bar);

/// `probe` as a fraction of the grid's spacing.
inline constexpr double kColliderProbe = 1e-4;

}  // namespace matterfit::shape
