// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/levels.hpp"

#include <algorithm>
#include <limits>

namespace matterfit::fit {
namespace {

/// Fewer particles than this are not worth a coarser level.
constexpr std::size_t kMany = 4000;
constexpr double kCellsAcross = 3.0;
constexpr int kCoarsest = 4;

/// Thinnest side of a body's box along its lattice, between the outermost particles [m].
double thinnest_side(const mpm::Body& body) {
  Vec3d low = Vec3d::Constant(std::numeric_limits<double>::infinity());
  Vec3d high = -low;
  for (const Vec3d& x : body.rest) {
    const Vec3d at = body.lattice.axes.conjugate() * x;
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  return (high - low).minCoeff();
}

}  // namespace

std::vector<double> usual_levels(const std::vector<mpm::Scene>& scenes) {
  struct Size {
    double dx = 0.0;
    std::size_t particles = 0;
    double thinnest = std::numeric_limits<double>::infinity();  // [m]
  };
  std::vector<Size> sizes;
  for (const mpm::Scene& scene : scenes) {
    Size& size = sizes.emplace_back();
    size.dx = scene.dx;
    for (const mpm::Body& body : scene.bodies) {
      size.particles += body.rest.size();
      size.thinnest = std::min(size.thinnest, thinnest_side(body));
    }
  }
  std::vector<double> levels{1.0};
  for (int level = 2; level <= kCoarsest; level *= 2) {
    bool pays = true;
    const double half = level / 2.0;
    for (const Size& size : sizes) {
      pays = pays && size.thinnest / (level * size.dx) + 0.5 >= kCellsAcross &&
             double(size.particles) >= double(kMany) * half * half * half;
    }
    if (!pays) break;
    levels.insert(levels.begin(), level);
  }
  return levels;
}

}  // namespace matterfit::fit
