// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/vec.hpp"
#include "mpm/layout.hpp"
#include "mpm/spline_weights.hpp"

namespace matterfit::mpm {

/// Where a particle lies in the sparse grid.
template <class S>
struct UpdatedPlace {
  std::uint32_t block;
  std::uint32_t cell;  ///< of the block: slab · 16 + lane
  S f[3];              ///< x/dx − base of the cell

  /// Calls visit(x, y, z, i, j, k) for the stencil's places: node 0…5 of the block with its halo.
  template <class Visit>
  void for_each_node(const Visit& visit) const {
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t k = 0; k < 3; ++k) {
          visit(cell / kLanes + i, cell / 4 % 4 + j, cell % 4 + k, i, j, k);
        }
  }
  [[nodiscard]] Vec3d fraction() const {
    return {static_cast<double>(f[0]), static_cast<double>(f[1]), static_cast<double>(f[2])};
  }
  /// World position in a block whose node (0, 0, 0) is at `origin`.
  [[nodiscard]] Vec3d position(const Vec3d& origin, double dx) const {
    const std::size_t x = cell / kLanes;
    const std::size_t y = cell / 4 % 4;
    const Vec3d corner(static_cast<double>(x), static_cast<double>(y),
                       static_cast<double>(cell % 4));
    return origin + (corner + fraction()) * dx;
  }
};

/// A place `offset` [cells] from a particle, in its own cell's polynomial. Towards the edge of the
/// outer node's support the offset shrinks: a node that has mass from this particle alone gets no
/// more than four times its share.
template <class S>
struct OffsetPlace {
  S f[3];
  S reach = S(1);  ///< share of the offset that is taken
  int axis = -1;   ///< that limits it

  OffsetPlace(const UpdatedPlace<S>& place, const S offset[3]) {
    for (int a = 0; a < 3; ++a) {
      const S to_edge = offset[a] < S(0) ? S(1.5) - place.f[a] : place.f[a] - S(0.5);
      const S share = to_edge / std::max(std::abs(offset[a]), S(1e-6));
      if (share < reach) {
        reach = share;
        axis = a;
      }
    }
    reach = std::max(reach, S(0));
    for (int a = 0; a < 3; ++a) f[a] = place.f[a] + reach * offset[a];
  }

  /// Adds to the cotangents of the particle's place and of the offset, both in cells, what comes
  /// back from that of `f`.
  void back(const S offset[3], const Vec3d& f_bar, Vec3d& place_bar, Vec3d& offset_bar) const {
    const auto share = static_cast<double>(reach);
    place_bar += f_bar;
    offset_bar += share * f_bar;
    if (axis < 0 || !(share > 0.0)) return;
    const auto o = static_cast<double>(offset[axis]);
    double share_bar = 0.0;
    for (int a = 0; a < 3; ++a) share_bar += f_bar[a] * static_cast<double>(offset[a]);
    const double size = std::max(std::abs(o), 1e-6);
    place_bar[axis] += (o < 0.0 ? -1.0 : 1.0) * share_bar / size;
    if (std::abs(o) > 1e-6) offset_bar[axis] -= share_bar * share / o;
  }
};

/// The block that holds node 0…5 along each axis of a block with its halo, as an index into its 27
/// neighbours.
[[nodiscard]] constexpr std::size_t neighbour_of_node(std::size_t x, std::size_t y, std::size_t z) {
  return 13 + 9 * (x / 4) + 3 * (y / 4) + z / 4;
}

}  // namespace matterfit::mpm
