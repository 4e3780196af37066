// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/surface_places.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "job/diagnosis/extent.hpp"

namespace matterfit::job {
namespace {

/// The mean of the particles that are outermost along `direction`, to within `slack` of the last.
Vec3d outermost(const mpm::Body& body, const Vec3d& direction, double slack) {
  double most = -std::numeric_limits<double>::infinity();
  for (const Vec3d& x : body.rest) most = std::max(most, direction.dot(x));
  Vec3d sum = Vec3d::Zero();
  double count = 0.0;
  for (const Vec3d& x : body.rest) {
    if (direction.dot(x) < most - slack) continue;
    sum += x;
    count += 1.0;
  }
  return sum / count;
}

}  // namespace

std::string words_of(const std::array<int, 3>& towards) {
  std::vector<std::string> axes;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (towards[axis] != 0) axes.push_back({towards[axis] > 0 ? '+' : '-', "xyz"[axis]});
  }
  std::string words = "towards";
  for (std::size_t k = 0; k < axes.size(); ++k) {
    if (k > 0) words += k + 1 == axes.size() ? " and" : ",";
    words += " " + axes[k];
  }
  return words;
}

std::vector<SurfacePlace> surface_places(const mpm::Body& body, double separation) {
  constexpr std::array<const char*, 4> kKinds = {"", "end", "edge", "corner"};
  const Extent extent = extent_of(body);
  const Vec3d half = 0.5 * (extent.high - extent.low).cwiseMax(separation);
  std::vector<SurfacePlace> places;
  for (std::size_t wanted = 1; wanted <= 3; ++wanted) {
    for (int code = 0; code < 27; ++code) {
      const std::array<int, 3> towards{code / 9 - 1, code / 3 % 3 - 1, code % 3 - 1};
      const Vec3d sign(towards[0], towards[1], towards[2]);
      if (std::size_t(sign.cwiseAbs().sum()) != wanted) continue;
      SurfacePlace& place = places.emplace_back();
      // In the body's own proportions, so that an edge of a long body is one; half a step along its
      // longest side counts as the same layer.
      const Vec3d direction = sign.cwiseQuotient(half);
      const double slack = 0.5 * separation / sign.cwiseAbs().cwiseProduct(half).maxCoeff();
      place.position = outermost(body, direction, slack) + 0.5 * separation * sign;
      place.words = std::string("at the ") + kKinds[wanted] + " " + words_of(towards);
    }
  }
  return places;
}

}  // namespace matterfit::job
