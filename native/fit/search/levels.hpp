// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mpm/scene.hpp"

namespace matterfit::fit {

/// The coarser resolutions at which a fit of these scenes is worth beginning, as multiples of their
/// particle separation, coarse first; the last is 1. One halves the resolution where the bodies are
/// many particles and keep three cells across.
[[nodiscard]] std::vector<double> usual_levels(const std::vector<mpm::Scene>& scenes);

}  // namespace matterfit::fit
