// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "mpm/renewed_body.hpp"
#include "mpm/renewed_grid.hpp"
#include "mpm/total_block_field.hpp"

namespace matterfit::mpm {

/// A particle of a renewed body where it is now, world axes.
struct RenewedParticle {
  Vec3d position;
  Vec3d velocity;
  Mat3d elastic;  ///< F; of a fluid J^⅓ I
};

/// Where a particle lies in a block's field.
template <class S>
[[nodiscard]] BlockField::Stencil block_stencil(const UpdatedPlace<S>& place, double dx) {
  return {{place.block, place.cell / kLanes, place.cell / 4 % 4, place.cell % 4, place.fraction()},
          dx};
}

/// World position of the node (0, 0, 0) of a block at the reference.
[[nodiscard]] inline Vec3d block_origin(const Vec3i& coordinates, double dx) {
  return coordinates.cast<double>() * (4.0 * dx);
}

/// Calls visit(slot, particle) for every particle of the body; by several threads at once. `nodes`:
/// RenewedGrid::nodes_of.
template <class S, class Visit>
void for_each_renewed(Arena& arena, const RenewedBody<S>& body,
                      const std::vector<std::uint32_t>& nodes,
                      const std::vector<double>& displacement, const std::vector<double>& velocity,
                      double dx, const Visit& visit) {
  arena.parallel_for(0, body.blocks(), 1, [&](std::size_t b) {
    BlockField u;
    BlockField v;
    u.gather(nodes.data() + 8 * b, displacement.data());
    v.gather(nodes.data() + 8 * b, velocity.data());
    const Vec3d origin = block_origin(body.coordinates()[b], dx);
    body.for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& place) {
      const BlockField::Stencil at = block_stencil(place, dx);
      const Mat3d moved = Mat3d::Identity() + u.gradient(at);
      RenewedParticle particle;
      particle.position = place.position(origin, dx) + u.at(at);
      particle.velocity = v.at(at);
      particle.elastic = body.is_fluid()
                             ? Mat3d(std::cbrt(moved.determinant()) * body.elastic(slot))
                             : Mat3d(moved * body.elastic(slot));
      visit(slot, particle);
    });
  });
}

}  // namespace matterfit::mpm
