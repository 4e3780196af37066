// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/vec.hpp"
#include "mpm/scene.hpp"

namespace matterfit::mpm {

/// Where a point lies against a pin's region.
struct RegionDistance {
  double distance = 0.0;  ///< signed, negative inside [m]
  Vec3d nearest =
      Vec3d::Zero();  ///< on the region's surface; the point itself inside `all`, `points`
};

/// The distance of a world point of the body at rest from the region.
[[nodiscard]] RegionDistance region_distance(const Pin& region, const Vec3d& point);

}  // namespace matterfit::mpm
