// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/nearest.hpp"

#include <nanoflann.hpp>

namespace matterfit::fit {
namespace {

struct Cloud {
  const Points& points;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<int>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>, Cloud, 3>;

}  // namespace

std::vector<Nearest> nearest(const Points& from, const Points& to, Arena& arena) {
  const Cloud cloud{to};
  Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  tree.buildIndex();
  std::vector<Nearest> found(from.size());
  arena.parallel_for(0, from.size(), 256, [&](std::size_t i) {
    nanoflann::KNNResultSet<double> result(1);
    result.init(&found[i].index, &found[i].squared);
    tree.findNeighbors(result, from[i].data(), nanoflann::SearchParams());
  });
  return found;
}

}  // namespace matterfit::fit
