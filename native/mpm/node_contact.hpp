// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "base/vec.hpp"
#include "shape/collider.hpp"

namespace matterfit::mpm {

/// A node this far outside a collider, in cells, still counts as inside.
inline constexpr double kNodeInside = 1e-9;

/// World position of node n, 0…63, of the block at `origin`.
[[nodiscard]] Vec3d position_of_node(const Vec3d& origin, double dx, std::size_t n);
/// False if no node of the block at `origin` can be inside.
[[nodiscard]] bool reaches_nodes(const shape::Collider& collider, const Vec3d& origin, double dx,
                                 double time);

/// Velocity of a node inside a collider after the contact; `v` before it [m/s].
[[nodiscard]] Vec3d node_response(const shape::Contact& contact, const shape::SurfacePoint& surface,
                                  const Vec3d& v);

/// The usual contact of MPM codes: velocities of the grid nodes inside a collider are projected.
/// Accurate to a cell only (docs/validation.md); kept for flows and for parity with other codes.
/// `mass` (64) and `velocity` ([3][64], m/s) are those of the block of nodes whose node (0, 0, 0)
/// is at `origin`.
template <class S>
void apply_node_contact(const shape::Collider& collider, const Vec3d& origin, double dx,
                        double time, const S* mass, S* velocity);

}  // namespace matterfit::mpm
