// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mpm/halo.hpp"
#include "mpm/layout.hpp"
#include "mpm/spline_weights.hpp"
#include "mpm/total_grid.hpp"

namespace matterfit::mpm {

/// The three components of a field at a node.
inline Vec3d field_value(const std::vector<double>& field, std::size_t node) {
  return {field[component_of(node, 0)], field[component_of(node, 1)], field[component_of(node, 2)]};
}
inline void set_field_value(std::vector<double>& field, std::size_t node, const Vec3d& value) {
  for (std::size_t c = 0; c < 3; ++c) field[component_of(node, c)] = value[static_cast<int>(c)];
}

/// The 27 nodes of the cell of a point and their weights there, looked up once for several fields.
/// Node (i, j, k) of the cell has the index 9i + 3j + k.
struct FieldStencil {
  PointStencil spline;
  std::array<std::size_t, 27> node;  ///< index in a field's component 0
  std::array<double, 27> weight;

  FieldStencil(const TotalGrid& grid, const CellPoint& point) : spline(point.f, grid.dx()) {
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
    std::size_t n = 0;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t k = 0; k < 3; ++k, ++n) {
          const std::size_t block = corners[corner[0][i] + corner[1][j] + corner[2][k]];
          node[n] = block * 3 * kBlockNodes + (place[0][i] + place[1][j] + place[2][k]);
          weight[n] = spline.weight(i, j, k);
        }
  }
};

/// Σ w_I u_I of a field of three components.
inline Vec3d field_at(const FieldStencil& s, const double* field) {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
  for (std::size_t n = 0; n < 27; ++n) {
    const double* at = field + s.node[n];
    x += s.weight[n] * at[0];
    y += s.weight[n] * at[kBlockNodes];
    z += s.weight[n] * at[2 * kBlockNodes];
  }
  return {x, y, z};
}

/// Σ u_I ∇w_I of values at the nodes of a cell: value(n).
template <class Value>
Vec3d gradient_of(const PointStencil& s, const Value& value) {
  const auto& [w, g] = s;
  Vec3d sum = Vec3d::Zero();
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const std::size_t n = 9 * i + 3 * j;
      const double u[3] = {value(n), value(n + 1), value(n + 2)};
      const double along = w[2][0] * u[0] + w[2][1] * u[1] + w[2][2] * u[2];
      const double slope = g[2][0] * u[0] + g[2][1] * u[1] + g[2][2] * u[2];
      sum[0] += g[0][i] * w[1][j] * along;
      sum[1] += w[0][i] * g[1][j] * along;
      sum[2] += w[0][i] * w[1][j] * slope;
    }
  return sum;
}

/// Σ u_I ⊗ ∇w_I.
inline Mat3d field_gradient(const FieldStencil& s, const double* field) {
  Mat3d h;
  for (int c = 0; c < 3; ++c) {
    const double* component = field + static_cast<std::size_t>(c) * kBlockNodes;
    h.row(c) = gradient_of(s.spline, [&](std::size_t n) { return component[s.node[n]]; });
  }
  return h;
}

/// The transpose of field_at(), of component c alone: adds w_I value to the nodes.
inline void add_to_field(const FieldStencil& s, std::size_t c, double value, double* field) {
  for (std::size_t n = 0; n < 27; ++n) field[s.node[n] + c * kBlockNodes] += s.weight[n] * value;
}

/// The transposes of both, of component c alone: adds w_I value + row · ∇w_I to the nodes.
inline void add_to_field(const FieldStencil& s, std::size_t c, double value, const Vec3d& row,
                         double* field) {
  const auto& [w, g] = s.spline;
  double* component = field + c * kBlockNodes;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const double both = w[0][i] * w[1][j];
      const double of_weight =
          both * value + row[0] * g[0][i] * w[1][j] + row[1] * w[0][i] * g[1][j];
      const double of_slope = both * row[2];
      for (std::size_t k = 0; k < 3; ++k) {
        component[s.node[9 * i + 3 * j + k]] += of_weight * w[2][k] + of_slope * g[2][k];
      }
    }
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
