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
