// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <optional>

#include "mpm/scene.hpp"

namespace matterfit::mpm {

/// The axis of a lattice with `axes` that the plane of a pin is normal to; nothing of other pins
/// and of slanted planes.
[[nodiscard]] std::optional<int> held_axis(const Pin& pin, const Mat3d& axes);

/// Axes of a body's lattice along which its total Lagrangian grid fits the shape at a spacing of
/// `dx` [m]: a plane that is held is the boundary of a cell, or both outermost faces are and are
/// flat. The grid is laid so on purpose (total_grid.cpp); shifted along such an axis it cuts cells
/// that were full, and errs as it never does where it lies.
[[nodiscard]] std::array<bool, 3> aligned_axes(const Body& body, double dx);

}  // namespace matterfit::mpm
