// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/thin.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

#include "base/error.hpp"

namespace matterfit::capture {

void thin(Points& positions, std::vector<double>& volumes, double separation) {
  if (!(separation > 0.0) || !std::isfinite(separation)) {
    throw_input("thinning particles: the separation must be above 0.");
  }
  if (positions.size() != volumes.size()) {
    throw_input("thinning particles: as many volumes as positions are needed.");
  }
  struct Cube {
    double volume = 0.0;
    Vec3d moment = Vec3d::Zero();
  };
  Vec3d low = Vec3d::Constant(std::numeric_limits<double>::infinity());
  for (const Vec3d& x : positions) low = low.cwiseMin(x);
  std::map<std::array<std::int64_t, 3>, Cube> cubes;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Vec3d at = (positions[i] - low) / separation;
    Cube& cube = cubes[{static_cast<std::int64_t>(std::floor(at.x())),
                        static_cast<std::int64_t>(std::floor(at.y())),
                        static_cast<std::int64_t>(std::floor(at.z()))}];
    cube.volume += volumes[i];
    cube.moment += volumes[i] * positions[i];
  }
  positions.clear();
  volumes.clear();
  for (const auto& [key, cube] : cubes) {
    if (!(cube.volume > 0.0)) continue;
    positions.push_back(cube.moment / cube.volume);
    volumes.push_back(cube.volume);
  }
}

}  // namespace matterfit::capture
