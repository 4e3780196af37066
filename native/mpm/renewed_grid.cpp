// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_grid.hpp"

#include <algorithm>

#include "mpm/total_quadrature.hpp"

namespace matterfit::mpm {

void RenewedGrid::link(const Cells& bodies) {
  const auto corner = [](int k) { return Vec3i(k / 4, k / 2 % 2, k % 2); };
  coordinates_.clear();
  for (const std::vector<Vec3i>* cells : bodies) {
    coordinates_.reserve(coordinates_.size() + 8 * cells->size());
    for (const Vec3i& block : *cells) {
      for (int k = 0; k < 8; ++k) coordinates_.push_back(block + corner(k));
    }
  }
  std::sort(coordinates_.begin(), coordinates_.end(), before);
  coordinates_.erase(std::unique(coordinates_.begin(), coordinates_.end()), coordinates_.end());
  nodes_.resize(bodies.size());
  sources_.resize(bodies.size());
  std::array<std::uint32_t, 8> none{};
  none.fill(kNoBlock);
  for (std::size_t m = 0; m < bodies.size(); ++m) {
    const std::vector<Vec3i>& cells = *bodies[m];
    nodes_[m].resize(8 * cells.size());
    sources_[m].assign(coordinates_.size(), none);
    for (std::size_t b = 0; b < cells.size(); ++b) {
      for (int k = 0; k < 8; ++k) {
        const auto at = std::lower_bound(coordinates_.begin(), coordinates_.end(),
                                         Vec3i(cells[b] + corner(k)), before);
        const auto node_block = static_cast<std::size_t>(at - coordinates_.begin());
        const auto which = static_cast<std::size_t>(k);
        nodes_[m][8 * b + which] = static_cast<std::uint32_t>(node_block);
        sources_[m][node_block][which] = static_cast<std::uint32_t>(b);
      }
    }
  }
}

}  // namespace matterfit::mpm
