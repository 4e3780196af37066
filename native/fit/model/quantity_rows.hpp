// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "fit/model/quantity.hpp"

/// The rows of the table of quantities by their owners, in the order in which quantities() has
/// them.
namespace matterfit::fit {

/// The numbers of a body's material: what its law takes, and damping, relaxation and a correction,
/// which every law takes (quantity_rows_material.cpp).
[[nodiscard]] std::vector<Quantity> material_rows();

/// A body's density, motion and placement; gravity; colliders and their contact; how a capture is
/// looked at (quantity_rows_scene.cpp).
[[nodiscard]] std::vector<Quantity> body_rows();
[[nodiscard]] std::vector<Quantity> scene_rows();
[[nodiscard]] std::vector<Quantity> collider_rows();
[[nodiscard]] std::vector<Quantity> capture_rows();

}  // namespace matterfit::fit
