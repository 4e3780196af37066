// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"

namespace matterfit::fit {

/// Points of a body's surface at rest: those of its particles that have neighbours on one side
/// only, each moved outward by half the edge of its volume [m³]. In the particles' order; empty
/// where none is such. The same for any number of threads.
[[nodiscard]] Points surface_points(const Points& rest, const std::vector<double>& volumes,
                                    Arena& arena);

}  // namespace matterfit::fit
