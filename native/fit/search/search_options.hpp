// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "fit/data/losses.hpp"

namespace matterfit::fit {

/// How a fit is searched for.
struct SearchOptions {
  Loss loss = Loss::kTracks;
  double huber = 0.0;   ///< [standard deviations]; 0: off
  int iterations = 30;  ///< at most, a stage
  bool windows = true;  ///< that grow; else the whole clip at once
  /// Particle separations as multiples of the scene's, coarse first; empty: as many as pay.
  std::vector<double> levels;
};

}  // namespace matterfit::fit
