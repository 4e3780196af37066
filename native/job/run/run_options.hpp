// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "job/run/cache.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {

struct RunOptions {
  int threads = 0;  ///< 0: as many as the machine has
  mpm::SimdTarget target = mpm::SimdTarget::kAuto;
  Restart restart = Restart::kNever;
};

}  // namespace matterfit::job
