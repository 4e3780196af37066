// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/vec.hpp"
#include "mpm/layout.hpp"
#include "mpm/spline_weights.hpp"
#include "mpm/total_grid.hpp"

namespace matterfit::mpm {

/// Weights and gradients [1/m] of a cell's 27 nodes at f = x/dx − base. Outside the cell its
/// polynomial goes on.
struct PointStencil {
  double w[3][3];
  double g[3][3];

  PointStencil(const Vec3d& f, double dx) {
    for (int axis = 0; axis < 3; ++axis) {
      quadratic_weights(f[axis], w[axis]);
      g[axis][0] = -(1.5 - f[axis]) / dx;
      g[axis][1] = -2.0 * (f[axis] - 1.0) / dx;
      g[axis][2] = (f[axis] - 0.5) / dx;
    }
  }
  [[nodiscard]] double weight(std::size_t i, std::size_t j, std::size_t k) const {
    return w[0][i] * w[1][j] * w[2][k];
  }
  [[nodiscard]] Vec3d gradient(std::size_t i, std::size_t j, std::size_t k) const {
    return {g[0][i] * w[1][j] * w[2][k], w[0][i] * g[1][j] * w[2][k], w[0][i] * w[1][j] * g[2][k]};
  }
};

/// Calls visit(index of the node in a field's component 0, i, j, k) for the 27 nodes of a cell.
template <class Visit>
void visit_nodes(const TotalGrid& grid, const CellPoint& point, const Visit& visit) {
  const std::uint32_t* corners = grid.block_nodes() + point.block * std::size_t{8};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t a = point.x + i;
        const std::size_t b = point.y + j;
        const std::size_t c = point.z + k;
        const std::size_t nodes = corners[a / 4 * 4 + b / 4 * 2 + c / 4];
        visit(nodes * 3 * kBlockNodes + node_index(a % 4, b % 4, c % 4), i, j, k);
      }
}

}  // namespace matterfit::mpm
