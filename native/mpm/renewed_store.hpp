// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/vec.hpp"
#include "mpm/layout.hpp"
#include "mpm/renewed_kernels.hpp"
#include "mpm/updated_place.hpp"

namespace matterfit::mpm {

/// What a body's particles have at a reference, in blocks of cells (layout.hpp), and what they do
/// there. A *slot* is chunk · 16 + lane.
template <class S>
struct RenewedStore {
  std::vector<Vec3i> coordinates;          ///< of blocks, sorted
  std::vector<std::uint32_t> first_chunk;  ///< of each slab, 4 a block, and the end
  std::vector<std::uint32_t> id;           ///< chunks × [16]: particle, or kNobody
  std::vector<S> geometry;                 ///< chunks × [4][16], as RenewedView
  std::vector<S> history;                  ///< chunks × [renewed_history()][16]
  std::vector<S> maxwell;                  ///< chunks × branches × [12][16], or empty

  static constexpr std::uint32_t kNobody = 0xffffffffU;
  [[nodiscard]] std::size_t chunks() const { return first_chunk.back(); }
  [[nodiscard]] std::size_t blocks() const { return coordinates.size(); }

  /// Calls visit(slot, place) for each particle of block b.
  template <class Visit>
  void for_each(std::size_t b, const Visit& visit) const {
    for (std::size_t slab = 0; slab < kSlabs; ++slab) {
      const std::size_t at = b * kSlabs + slab;
      for (std::size_t chunk = first_chunk[at]; chunk < first_chunk[at + 1]; ++chunk) {
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
          const std::size_t slot = chunk * kLanes + lane;
          if (id[slot] != kNobody) visit(slot, place(b, slab, slot));
        }
      }
    }
  }
  [[nodiscard]] UpdatedPlace<S> place(std::size_t block, std::size_t slab, std::size_t slot) const {
    const S* g = geometry.data() + slot / kLanes * (4 * kLanes) + slot % kLanes;
    return {static_cast<std::uint32_t>(block),
            static_cast<std::uint32_t>(slab * kLanes + slot % kLanes),
            {g[0], g[kLanes], g[2 * kLanes]}};
  }
  [[nodiscard]] double volume(std::size_t slot) const {
    return static_cast<double>(geometry[slot / kLanes * (4 * kLanes) + 3 * kLanes + slot % kLanes]);
  }
};

/// Elastic F at the reference of the particle in `slot`; `history` of RenewedStore, `fluid`: it is
/// J − 1 alone.
template <class S>
[[nodiscard]] Mat3d renewed_elastic(const std::vector<S>& history, bool fluid, std::size_t slot) {
  const std::size_t kept = renewed_history(fluid);
  const S* h = history.data() + slot / kLanes * (kept * kLanes) + slot % kLanes;
  if (fluid) return std::cbrt(1.0 + static_cast<double>(h[0])) * Mat3d::Identity();
  Mat3d f = Mat3d::Identity();
  for (std::size_t i = 0; i < 9; ++i) {
    f(static_cast<int>(i / 3), static_cast<int>(i % 3)) += static_cast<double>(h[i * kLanes]);
  }
  return f;
}

}  // namespace matterfit::mpm
