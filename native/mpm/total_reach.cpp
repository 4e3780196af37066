// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>

#include "mpm/total_grid.hpp"

namespace matterfit::mpm {
namespace {

/// A plane's cosine with the direction below which the box limits it, and from which it is met
/// wherever it lies up to kFarthest; between them the limit goes over smoothly.
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
  Reach least{0.5 * side, Vec3d::Zero()};
  bool any = false;
  for (std::uint32_t k = skin_first_[particle]; k < skin_first_[particle + 1]; ++k) {
    const SkinPlane& plane = skin_[k];
    const double cosine = plane.normal.dot(direction);
    if (cosine <= 0.0) continue;
    // The ray to the plane, no longer than what the plane's aspect allows.
    const double s = std::clamp((cosine - kAside) / (kFacing - kAside), 0.0, 1.0);
    const double most = side * (0.5 + (kFarthest - 0.5) * s * s * (3.0 - 2.0 * s));
    const double ray = std::max(plane.depth, kShallowest * side) / cosine;
    const double distance = std::min(ray, most);
    if (any && distance >= least.distance) continue;
    any = true;
    const double slope = ray < most
                             ? -ray / cosine
                             : side * (kFarthest - 0.5) * 6.0 * s * (1.0 - s) / (kFacing - kAside);
    least = {distance, slope * plane.normal};
  }
  return least;
}

}  // namespace matterfit::mpm
