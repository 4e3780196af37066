// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/nearest.hpp"

#include "capture/point_tree.hpp"

namespace matterfit::fit {

std::vector<Nearest> nearest(const Points& from, const Points& to, Arena& arena) {
  const capture::PointCloud cloud{to};
  capture::PointTree<> tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
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
