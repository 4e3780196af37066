// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mpm/scene.hpp"

namespace matterfit::mpm {

/// Throws Error(kInput) for what cannot be simulated, naming body or key, value and remedy.
void check_scene(const Scene& scene);

/// The formulation that a body takes: its own word, or by its law.
[[nodiscard]] bool is_total(const Body& body);
[[nodiscard]] bool is_renewed(const Body& body);
[[nodiscard]] bool is_updated(const Body& body);

}  // namespace matterfit::mpm
