// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>

#include "mpm/total_node_term.hpp"

namespace matterfit::mpm {

/// The i-th pin of a total Lagrangian body. Accurate below the cell:
/// - one of the whole body prescribes every node;
/// - a plane on the boundary of cells at the body's end holds that plane: there a quadratic spline
///   is the mean of the two nodes beside it, so the node behind is the mirror image of the one
///   before, u₀ = 2ū − u₁, masses and forces folded;
/// - any other constrains points of the held region, Σ w_I(X_c) v_I = v̄, through (C M⁻¹ Cᵀ)⁻¹,
///   rank-checked and factorised once.
/// Throws Error(kInput) for a pin that holds no part of the body.
[[nodiscard]] std::unique_ptr<TotalNodeTerm> make_total_pin(const Body& body, std::size_t i,
                                                            const TotalGrid& grid);

}  // namespace matterfit::mpm
