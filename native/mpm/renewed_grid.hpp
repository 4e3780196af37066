// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/vec.hpp"
#include "mpm/layout.hpp"

namespace matterfit::mpm {

/// The blocks of nodes that renewed bodies share at one reference, and how their blocks of cells
/// meet there. World axes; node i lies at i dx.
class RenewedGrid {
 public:
  /// Block coordinates of each body's cells, sorted.
  using Cells = std::vector<const std::vector<Vec3i>*>;

  /// Makes the blocks of nodes that the cells touch.
  void link(const Cells& bodies);

  [[nodiscard]] std::size_t size() const { return coordinates_.size(); }
  [[nodiscard]] const Vec3i& coordinates(std::size_t block) const { return coordinates_[block]; }
  /// Flat [8] a block of the body's cells: node blocks at (+a, +b, +c), index 4a+2b+c.
  [[nodiscard]] const std::vector<std::uint32_t>& nodes_of(std::size_t body) const {
    return nodes_[body];
  }
  /// The body's blocks at (−a, −b, −c) of a node block; kNoBlock where there is none.
  [[nodiscard]] const std::array<std::uint32_t, 8>& sources(std::size_t body,
                                                            std::size_t block) const {
    return sources_[body][block];
  }

 private:
  std::vector<Vec3i> coordinates_;  ///< sorted
  std::vector<std::vector<std::uint32_t>> nodes_;
  std::vector<std::vector<std::array<std::uint32_t, 8>>> sources_;
};

}  // namespace matterfit::mpm
