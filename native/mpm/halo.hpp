// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "mpm/layout.hpp"

namespace matterfit::mpm {

/// Adds to the 64 nodes of a block what the block at (−a, −b, −c), `k` = 4a+2b+c, has for them in
/// one component of its halo (6³ nodes, layout.hpp).
template <class S, class Sum>
void add_halo(std::size_t k, const S* halo, Sum* nodes) {
  const std::size_t x0 = k / 4 * 4;
  const std::size_t y0 = k / 2 % 2 * 4;
  const std::size_t z0 = k % 2 * 4;
  const std::size_t nx = x0 != 0 ? 2 : 4;
  const std::size_t ny = y0 != 0 ? 2 : 4;
  const std::size_t nz = z0 != 0 ? 2 : 4;
  for (std::size_t x = 0; x < nx; ++x)
    for (std::size_t y = 0; y < ny; ++y)
      for (std::size_t z = 0; z < nz; ++z)
        nodes[node_index(x, y, z)] += static_cast<Sum>(halo[halo_index(x + x0, y + y0, z + z0)]);
}

}  // namespace matterfit::mpm
