// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "job/diagnosis/causes.hpp"

namespace matterfit::job {

/// The catalogue's terms with a stress, measured by the body's own stiffness: an inclusion at some
/// places of the body, a gradient, fibres along some directions, strain stiffening. None for
/// fluids, whose stiffness is not one of shape.
[[nodiscard]] std::vector<Cause> stiffness_causes(const mpm::Scene& scene);

}  // namespace matterfit::job
