// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <limits>

#include "mpm/total_grid.hpp"

namespace matterfit::mpm {
namespace {

/// A ray ends at the first plane, and goes no farther than the face of the particle's box unless a
/// plane faces it: from the first cosine on the limit grows smoothly, up to kFarthest at the
/// second.
constexpr double kAside = 0.55;
constexpr double kFacing = 0.85;
/// In sides of a particle's box: a cell of which less than a half is inside gives its volume to
/// this one, and its face lies up to one side farther out.
constexpr double kFarthest = 1.5;
/// In sides of the box: what a centre lies below its planes at least, so that none ends at once
/// where it turns away.
constexpr double kShallowest = 0.05;

}  // namespace

void TotalGrid::sort_skin(const std::vector<SkinPlane>& skin) {
  skin_ = skin;
  skin_first_.assign(1, 0);
  for (std::uint32_t p = 0; p < rest_.size(); ++p) {
    std::uint32_t end = skin_first_.back();
    while (end < skin_.size() && skin_[end].particle == p) ++end;
    skin_first_.push_back(end);
  }
}

TotalGrid::Reach TotalGrid::reach(std::uint32_t particle, const Vec3d& direction) const {
  const double side = std::cbrt(volumes_[particle]);
  Reach ray{std::numeric_limits<double>::infinity(), Vec3d::Zero()};
  Reach most{0.5 * side, Vec3d::Zero()};
  for (std::uint32_t k = skin_first_[particle]; k < skin_first_[particle + 1]; ++k) {
    const SkinPlane& plane = skin_[k];
    const double cosine = plane.normal.dot(direction);
    if (cosine <= 0.0) continue;
    const double distance = std::max(plane.depth, kShallowest * side) / cosine;
    if (distance < ray.distance) ray = {distance, -distance / cosine * plane.normal};
    const double s = std::clamp((cosine - kAside) / (kFacing - kAside), 0.0, 1.0);
    const double limit = side * (0.5 + (kFarthest - 0.5) * s * s * (3.0 - 2.0 * s));
    const double slope = side * (kFarthest - 0.5) * 6.0 * s * (1.0 - s) / (kFacing - kAside);
    if (limit > most.distance) most = {limit, slope * plane.normal};
  }
  return ray.distance < most.distance ? ray : most;
}

}  // namespace matterfit::mpm
