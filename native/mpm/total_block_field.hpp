// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "mpm/halo.hpp"
#include "mpm/layout.hpp"
#include "mpm/spline_weights.hpp"
#include "mpm/total_grid.hpp"

namespace matterfit::mpm {

/// Three components of a field at the 6³ nodes that a block of cells touches, node by node: for
/// looking at many points of a block, or for adding at many of them.
class BlockField {
 public:
  /// The stencil of a point in the block.
  struct Stencil {
    PointStencil spline;
    std::size_t first;  ///< node of its cell
    Stencil(const CellPoint& point, double dx)
        : spline(point.f, dx), first(halo_index(point.x, point.y, point.z)) {}
  };

  void clear() { nodes_.fill(Eigen::Vector4d::Zero()); }
  /// What `field`, node blocks × [3][64], has there.
  void gather(const TotalGrid& grid, std::size_t block, const double* field) {
    gather(grid.block_nodes() + block * 8, field);
  }
  /// The same of the node blocks `nodes` [8] at (+a, +b, +c), index 4a+2b+c.
  void gather(const std::uint32_t* nodes, const double* field) {
    for (std::size_t k = 0; k < 8; ++k) {
      const double* from = field + nodes[k] * kNodeBlock;
      for_each_shared_node(k, [&](std::size_t node, std::size_t here) {
        nodes_[here] << from[node], from[node + kBlockNodes], from[node + 2 * kBlockNodes], 0.0;
      });
    }
  }
  /// Adds what lies on the nodes of the node block at (4a, 4b, 4c) from the block, `k` = 4a+2b+c,
  /// to `nodes` [3][64].
  void add_to(std::size_t k, double* nodes) const {
    for_each_shared_node(k, [&](std::size_t node, std::size_t here) {
      for (std::size_t c = 0; c < 3; ++c) {
        nodes[node + c * kBlockNodes] += nodes_[here][static_cast<int>(c)];
      }
    });
  }

  /// Adds it to a halo [3][216].
  template <class S>
  void add_to_halo(S* halo) const {
    for (std::size_t node = 0; node < kHaloNodes; ++node) {
      for (std::size_t c = 0; c < 3; ++c) {
        halo[c * kHaloNodes + node] += static_cast<S>(nodes_[node][static_cast<int>(c)]);
      }
    }
  }

  /// Σ w_I u_I.
  [[nodiscard]] Vec3d at(const Stencil& s) const {
    const auto& w = s.spline.w;
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for_each_row(s, [&](std::size_t i, std::size_t j, const Eigen::Vector4d* row) {
      sum += (w[0][i] * w[1][j]) * (w[2][0] * row[0] + w[2][1] * row[1] + w[2][2] * row[2]);
    });
    return sum.head<3>();
  }
  /// Σ u_I ⊗ ∇w_I.
  [[nodiscard]] Mat3d gradient(const Stencil& s) const {
    const auto& [w, g] = s.spline;
    Eigen::Vector4d x = Eigen::Vector4d::Zero();
    Eigen::Vector4d y = Eigen::Vector4d::Zero();
    Eigen::Vector4d z = Eigen::Vector4d::Zero();
    for_each_row(s, [&, &w = w, &g = g](std::size_t i, std::size_t j, const Eigen::Vector4d* row) {
      const Eigen::Vector4d along = w[2][0] * row[0] + w[2][1] * row[1] + w[2][2] * row[2];
      const Eigen::Vector4d slope = g[2][0] * row[0] + g[2][1] * row[1] + g[2][2] * row[2];
      x += (g[0][i] * w[1][j]) * along;
      y += (w[0][i] * g[1][j]) * along;
      z += (w[0][i] * w[1][j]) * slope;
    });
    Mat3d h;
    h << x.head<3>(), y.head<3>(), z.head<3>();
    return h;
  }
  /// Σ (∇∇w_I) rowsᵀ u_I: how rows : gradient() changes with the place.
  [[nodiscard]] Vec3d slope(const Stencil& s, const Mat3d& rows) const {
    const double inverse_dx = s.spline.g[0][2] - s.spline.g[0][0];
    Vec3d sum = Vec3d::Zero();
    for_each_row(s, [&](std::size_t i, std::size_t j, const Eigen::Vector4d* row) {
      for (std::size_t k = 0; k < 3; ++k) {
        sum +=
            s.spline.curvature(i, j, k, 1.0 / inverse_dx) * (rows.transpose() * row[k].head<3>());
      }
    });
    return sum;
  }
  /// The transpose of at(): adds w_I value to the nodes.
  void add(const Stencil& s, const Vec3d& value) { add(s, value, Mat3d::Zero()); }
  /// The transposes of both: adds w_I value + rows ∇w_I to the nodes.
  void add(const Stencil& s, const Vec3d& value, const Mat3d& rows) {
    const auto& [w, g] = s.spline;
    Eigen::Vector4d v(value[0], value[1], value[2], 0.0);
    Eigen::Vector4d d[3];
    for (int axis = 0; axis < 3; ++axis) {
      d[axis] << rows(0, axis), rows(1, axis), rows(2, axis), 0.0;
    }
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) {
        const double both = w[0][i] * w[1][j];
        const Eigen::Vector4d of_weight =
            both * v + (g[0][i] * w[1][j]) * d[0] + (w[0][i] * g[1][j]) * d[1];
        const Eigen::Vector4d of_slope = both * d[2];
        Eigen::Vector4d* row = &nodes_[s.first + i * halo_index(1, 0, 0) + j * halo_index(0, 1, 0)];
        for (std::size_t k = 0; k < 3; ++k) row[k] += w[2][k] * of_weight + g[2][k] * of_slope;
      }
  }

 private:
  template <class Use>
  void for_each_row(const Stencil& s, const Use& use) const {
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        use(i, j, &nodes_[s.first + i * halo_index(1, 0, 0) + j * halo_index(0, 1, 0)]);
  }
  std::array<Eigen::Vector4d, kHaloNodes> nodes_;
};

}  // namespace matterfit::mpm
