// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "mpm/layout.hpp"

namespace matterfit::mpm {

/// use(node, place) of the nodes of a block that the block at (−a, −b, −c), `k` = 4a+2b+c, has at
/// `place` of its halo (6³ nodes, layout.hpp).
template <class Use>
void for_each_shared_node(std::size_t k, const Use& use) {
  const std::size_t x0 = k / 4 * 4;
  const std::size_t y0 = k / 2 % 2 * 4;
  const std::size_t z0 = k % 2 * 4;
  const std::size_t nx = x0 != 0 ? 2 : 4;
  const std::size_t ny = y0 != 0 ? 2 : 4;
  const std::size_t nz = z0 != 0 ? 2 : 4;
  for (std::size_t x = 0; x < nx; ++x)
    for (std::size_t y = 0; y < ny; ++y)
      for (std::size_t z = 0; z < nz; ++z)
        use(node_index(x, y, z), halo_index(x + x0, y + y0, z + z0));
}

/// Adds to the 64 nodes of a block what such a block has for them in one component of its halo.
template <class S, class Sum>
void add_halo(std::size_t k, const S* halo, Sum* nodes) {
  for_each_shared_node(k, [&](std::size_t node, std::size_t place) {
    nodes[node] += static_cast<Sum>(halo[place]);
  });
}

}  // namespace matterfit::mpm
