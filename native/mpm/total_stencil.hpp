// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "mpm/halo.hpp"
#include "mpm/layout.hpp"
#include "mpm/spline_weights.hpp"
#include "mpm/total_grid.hpp"

namespace matterfit::mpm {

/// Calls visit(index of the node in a field's component 0, i, j, k) for the 27 nodes of a cell.
template <class Visit>
void visit_nodes(const TotalGrid& grid, const CellPoint& point, const Visit& visit) {
  const std::uint32_t* corners = grid.block_nodes() + point.block * std::size_t{8};
  std::size_t corner[3][3];
  std::size_t place[3][3];
  for (std::size_t i = 0; i < 3; ++i) {
    corner[0][i] = (point.x + i) / 4 * 4;
    corner[1][i] = (point.y + i) / 4 * 2;
    corner[2][i] = (point.z + i) / 4;
    place[0][i] = node_index((point.x + i) % 4, 0, 0);
    place[1][i] = node_index(0, (point.y + i) % 4, 0);
    place[2][i] = node_index(0, 0, (point.z + i) % 4);
  }
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t nodes = corners[corner[0][i] + corner[1][j] + corner[2][k]];
        visit(nodes * 3 * kBlockNodes + (place[0][i] + place[1][j] + place[2][k]), i, j, k);
      }
}

/// Σ w_I u_I of a field of three components.
inline Vec3d field_at(const TotalGrid& grid, const CellPoint& point, const PointStencil& s,
                      const double* field) {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
  visit_nodes(grid, point, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
    const double w = s.weight(i, j, k);
    x += w * field[node];
    y += w * field[node + kBlockNodes];
    z += w * field[node + 2 * kBlockNodes];
  });
  return {x, y, z};
}

/// Σ u_I ⊗ ∇w_I.
inline Mat3d field_gradient(const TotalGrid& grid, const CellPoint& point, const PointStencil& s,
                            const double* field) {
  double h[3][3] = {};
  visit_nodes(grid, point, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
    const Vec3d g = s.gradient(i, j, k);
    for (std::size_t c = 0; c < 3; ++c) {
      const double u = field[node + c * kBlockNodes];
      h[c][0] += u * g[0];
      h[c][1] += u * g[1];
      h[c][2] += u * g[2];
    }
  });
  Mat3d out;
  for (int c = 0; c < 3; ++c) out.row(c) << h[c][0], h[c][1], h[c][2];
  return out;
}

/// The transpose of field_at(): adds w_I value to the nodes.
inline void add_to_field(const TotalGrid& grid, const CellPoint& point, const PointStencil& s,
                         const Vec3d& value, double* field) {
  visit_nodes(grid, point, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
    const double w = s.weight(i, j, k);
    for (int c = 0; c < 3; ++c) {
      field[node + static_cast<std::size_t>(c) * kBlockNodes] += w * value[c];
    }
  });
}

/// The transposes of both: adds w_I value + matrix ∇w_I to the nodes.
inline void add_to_field(const TotalGrid& grid, const CellPoint& point, const PointStencil& s,
                         const Vec3d& value, const Mat3d& matrix, double* field) {
  visit_nodes(grid, point, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
    const double w = s.weight(i, j, k);
    const Vec3d g = s.gradient(i, j, k);
    for (int c = 0; c < 3; ++c) {
      field[node + static_cast<std::size_t>(c) * kBlockNodes] +=
          w * value[c] + (matrix(c, 0) * g[0] + matrix(c, 1) * g[1] + matrix(c, 2) * g[2]);
    }
  });
}

/// Three components of the 64 nodes of a node block, summed over the halos of the blocks that touch
/// them, into `out` [3][64]. `halos`: blocks × [3][216].
template <class S>
void sum_halos(const TotalGrid& grid, const S* halos, std::size_t node_block, double* out) {
  std::fill(out, out + 3 * kBlockNodes, 0.0);
  const auto& sources = grid.node_sources(node_block);
  for (std::size_t k = 0; k < 8; ++k) {
    const std::size_t source = sources[k];
    if (source == kNoBlock) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      add_halo(k, halos + (source * 3 + c) * kHaloNodes, out + c * kBlockNodes);
    }
  }
}

}  // namespace matterfit::mpm
