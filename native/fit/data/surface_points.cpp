// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/surface_points.hpp"

#include <cmath>
#include <utility>
#include <vector>

#include "capture/point_tree.hpp"

namespace matterfit::fit {
namespace {

/// In edges of a particle: a ball with some 18 others, whose mean is .38 off at a lattice's face
/// and, of jittered ones inside, .14.
constexpr double kSampleReach = 1.6;
constexpr double kOneSided = 0.31;

}  // namespace

Points surface_points(const Points& rest, const std::vector<double>& volumes, Arena& arena) {
  const capture::PointCloud cloud{rest};
  capture::PointTree<> tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  if (!rest.empty()) tree.buildIndex();
  Points outward(rest.size(), Vec3d::Zero());
  arena.parallel_for(0, rest.size(), 256, [&](std::size_t i) {
    std::vector<std::pair<std::size_t, double>> near;
    const double edge = std::cbrt(volumes[i]);
    const double reach = kSampleReach * edge;
    tree.radiusSearch(rest[i].data(), reach * reach, near, nanoflann::SearchParams(32, 0.0F, true));
    Vec3d mean = Vec3d::Zero();
    if (near.size() < 2) return;
    for (const auto& [j, squared] : near) mean += (rest[j] - rest[i]) / double(near.size() - 1);
    const double off = mean.norm();
    if (off > kOneSided * edge) outward[i] = -0.5 * edge / off * mean;
  });
  Points surface;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    if (!outward[i].isZero(0.0)) surface.push_back(rest[i] + outward[i]);
  }
  return surface;
}

}  // namespace matterfit::fit
