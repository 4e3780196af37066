// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <string>
#include <vector>

#include "mpm/scene.hpp"

namespace matterfit::job {

/// Where on a body something may hang, and how a sentence says it.
struct SurfacePlace {
  Vec3d position = Vec3d::Zero();  ///< at rest [m]
  std::string words;               ///< "at the end towards +x"
};

/// "towards +x, +y and -z" of {1, 1, -1}: axes whose number is 0 are left out, one at least is not.
[[nodiscard]] std::string words_of(const std::array<int, 3>& towards);

/// Ends, edges and corners of a body, the 26 directions of a box: the middle of its outermost
/// particles in each, and half a separation on. `separation` [m] is that of its particles.
[[nodiscard]] std::vector<SurfacePlace> surface_places(const mpm::Body& body, double separation);

}  // namespace matterfit::job
