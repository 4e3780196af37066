// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "job/diagnosis/causes.hpp"

namespace matterfit::job {

/// A force field that acts for a while, in one place, or both, where an encounter that lasts shows
/// one. Its numbers: the acceleration [m/s²], three. Nothing where there is none, or the scene has
/// a force field already.
[[nodiscard]] std::optional<Cause> push(const std::vector<Encounter>& encounters,
                                        const mpm::Scene& scene);

}  // namespace matterfit::job
