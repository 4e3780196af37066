// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/vec.hpp"

namespace matterfit::mpm {

/// One frame as an observer sees it: FrameState's positions and velocities without rounding.
struct ObservedFrame {
  struct Body {
    std::vector<Vec3d> positions;   ///< [m]
    std::vector<Vec3d> velocities;  ///< [m/s]
    /// FrameState's, the elastic part where a law flows; empty where they were not asked for.
    std::vector<Mat3d> deformation_gradients;
  };
  int frame = 0;
  double time = 0.0;  ///< seconds after the scene's first frame
  std::vector<Body> bodies;
};

}  // namespace matterfit::mpm
