// SPDX-License-Identifier: GPL-3.0-or-later
// What nanoflann wants to know of points.
#pragma once

#include <cstddef>
#include <nanoflann.hpp>
#include <span>

#include "base/vec.hpp"

namespace matterfit::capture {

/// A view: the points outlive it.
struct PointCloud {
  std::span<const Vec3d> points;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

/// k-d tree over a PointCloud; distances are squared.
template <class Index = std::size_t>
using PointTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointCloud>,
                                        PointCloud, 3, Index>;

}  // namespace matterfit::capture
