// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>

namespace matterfit::mpm {

/// A hash of the integer coordinates of a cell or a block.
struct CellHash {
  std::size_t operator()(const std::array<int, 3>& c) const {
    std::size_t h = static_cast<std::size_t>(c[0]) * 73856093U;
    h ^= static_cast<std::size_t>(c[1]) * 19349663U;
    h ^= static_cast<std::size_t>(c[2]) * 83492791U;
    return h;
  }
};

}  // namespace matterfit::mpm
