// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "job/diagnosis/causes.hpp"

namespace matterfit::job {

/// What may be wrong with the contact between the first body of a scene and each of its colliders:
/// friction, its kind, what it takes of a bounce, how a level ground slopes. `fitted`: what a
/// fit moves. `job` and `scene` are of the same job.
[[nodiscard]] std::vector<Cause> contact_causes(const Job& job, const mpm::Scene& scene,
                                                const std::vector<fit::Address>& fitted);

}  // namespace matterfit::job
