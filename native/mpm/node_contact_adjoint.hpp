// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "shape/collider_adjoint.hpp"

namespace matterfit::mpm {

/// Adjoint of apply_node_contact(), of all colliders in turn, at a block's nodes: `velocity` is the
/// one before the first. `velocity_bar` ([3][64]) goes from after to before; `bars`, one for each
/// collider, are sums. A node that is inside stays inside: what a collider's place changes about
/// that is a jump and not a derivative. `displacement` ([3][64], m): where nodes are met from where
/// the grid has them, with its cotangent, a sum; or null.
template <class S>
void node_contact_adjoint(const std::vector<shape::ColliderPtr>& colliders, const Vec3d& origin,
                          double dx, double time, const S* mass, const S* velocity,
                          double* velocity_bar, shape::ColliderCotangents* bars,
                          const double* displacement = nullptr, double* displacement_bar = nullptr);

}  // namespace matterfit::mpm
