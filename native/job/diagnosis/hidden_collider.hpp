// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "job/diagnosis/causes.hpp"
#include "job/diagnosis/encounters.hpp"

namespace matterfit::job {

/// A plane or a sphere at one of the encounters that turn the body at once. Its numbers: how far it
/// reaches into where the body would pass [m], 0: not at all; two angles [rad] between its normal
/// and the impulse that showed it, in which its friction has a part; and that friction. Nothing
/// where there are none.
[[nodiscard]] std::optional<Cause> hidden_collider(const std::vector<Encounter>& encounters,
                                                   const mpm::Scene& scene);

}  // namespace matterfit::job
