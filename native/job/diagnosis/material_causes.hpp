// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "job/diagnosis/causes.hpp"

namespace matterfit::job {

/// What may be wrong with the material of the first body of a scene: damping, relaxation, that it
/// yields, and each parameter of its law that a fit does not move.
[[nodiscard]] std::vector<Cause> material_causes(const mpm::Scene& scene,
                                                 const CauseOptions& options);

}  // namespace matterfit::job
