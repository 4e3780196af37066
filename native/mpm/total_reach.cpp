// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>

#include "mpm/total_grid.hpp"

namespace matterfit::mpm {
namespace {

/// Cosines of a plane's normal with the direction: below the first the plane does not count, from
/// the second on it does so fully.
constexpr double kAside = 0.55;
constexpr double kFacing = 0.85;
/// In sides of a particle's box: where planes lie that count. A cell of which less than a half is
/// inside gives its volume to this one, and its face lies up to one side farther out.
constexpr double kNearest = 0.05;
constexpr double kFarthest = 1.5;

}  // namespace

void TotalGrid::index_skin(const std::vector<SkinPlane>& skin) {
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
  // The face of the box, moved out by what the planes that face the direction are off it.
  double moved = 0.0;
  double sum = 0.0;
  Vec3d moved_slope = Vec3d::Zero();
  Vec3d sum_slope = Vec3d::Zero();
  for (std::uint32_t k = skin_first_[particle]; k < skin_first_[particle + 1]; ++k) {
    const SkinPlane& plane = skin_[k];
    const double s = std::min((plane.normal.dot(direction) - kAside) / (kFacing - kAside), 1.0);
    if (s <= 0.0) continue;
    const double weight = s * s * (3.0 - 2.0 * s);
    const Vec3d slope = 6.0 * s * (1.0 - s) / (kFacing - kAside) * plane.normal;
    const double off = std::clamp(plane.depth, kNearest * side, kFarthest * side) - 0.5 * side;
    moved += weight * weight * off;
    sum += weight;
    moved_slope += 2.0 * weight * off * slope;
    sum_slope += slope;
  }
  if (!(sum > 0.0)) return {0.5 * side, Vec3d::Zero()};
  return {0.5 * side + moved / sum, moved_slope / sum - moved / (sum * sum) * sum_slope};
}

}  // namespace matterfit::mpm
