// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "job/diagnosis/causes.hpp"

namespace matterfit::job {

/// What a camera, a clock or a tracker may do to a recording of the scene's first body; `fitted`:
/// what a fit moves.
[[nodiscard]] std::vector<Cause> measurement_causes(const Job& job, const mpm::Scene& scene,
                                                    const std::vector<fit::Address>& fitted);

}  // namespace matterfit::job
