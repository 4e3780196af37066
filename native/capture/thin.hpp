// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/vec.hpp"

namespace matterfit::capture {

/// Particles that stand for many: those of each cube of edge `separation` (world axes, from the
/// lowest corner on) become one at their centre of mass with the volume of all, in the order of the
/// cubes. Volume and centre of mass stay. Throws Error(kInput) for a separation that is not above
/// 0 and lists of unequal lengths.
void thin(Points& positions, std::vector<double>& volumes, double separation);

}  // namespace matterfit::capture
