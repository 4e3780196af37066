// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/pin_region.hpp"

#include <limits>

namespace matterfit::mpm {

RegionDistance region_distance(const Pin& region, const Vec3d& point) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  switch (region.region) {
    case Pin::Region::kAll:
      break;
    case Pin::Region::kPlane: {
      const Vec3d n = region.normal.normalized();
      const double d = n.dot(point - region.point);
      return {d, point - d * n};
    }
    case Pin::Region::kBox: {
      Vec3d nearest = point.cwiseMax(region.low).cwiseMin(region.high);
      const double outside = (point - nearest).norm();
      if (outside > 0.0) return {outside, nearest};
      int axis = 0;
      const double inside = (point - region.low).cwiseMin(region.high - point).minCoeff(&axis);
      const double middle = 0.5 * (region.low[axis] + region.high[axis]);
      nearest[axis] = point[axis] > middle ? region.high[axis] : region.low[axis];
      return {-inside, nearest};
    }
    case Pin::Region::kSphere: {
      const Vec3d d = point - region.point;
      const double length = d.norm();
      return {length - region.radius,
              length > 0.0 ? Vec3d(region.point + d * (region.radius / length)) : point};
    }
    case Pin::Region::kPoints: {
      double least = kFar;
      Vec3d closest = point;
      for (const Vec3d& p : region.points) {
        const double length = (point - p).norm();
        if (length >= least) continue;
        least = length;
        closest = p;
      }
      if (least <= region.radius) return {least - region.radius, point};
      return {least - region.radius, closest + (point - closest) * (region.radius / least)};
    }
  }
  return {-kFar, point};
}

}  // namespace matterfit::mpm
