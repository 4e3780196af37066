// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>

#include "mpm/scene.hpp"

namespace matterfit::job {

/// A body at rest.
struct Extent {
  Vec3d low = Vec3d::Zero();
  Vec3d high = Vec3d::Zero();
  Vec3d center = Vec3d::Zero();  ///< of volume
  double size = 0.0;             ///< longest side [m]
  double volume = 0.0;           ///< [m³]
};

[[nodiscard]] inline Extent extent_of(const mpm::Body& body) {
  Eigen::AlignedBox3d box;
  Extent extent;
  for (std::size_t i = 0; i < body.rest.size(); ++i) {
    box.extend(body.rest[i]);
    extent.center += body.volumes[i] * body.rest[i];
    extent.volume += body.volumes[i];
  }
  extent.low = box.min();
  extent.high = box.max();
  extent.center /= extent.volume;
  extent.size = box.sizes().maxCoeff();
  return extent;
}

}  // namespace matterfit::job
