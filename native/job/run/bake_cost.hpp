// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "job/documents/document.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {

struct BakeCost {
  double begin = 0.0;    ///< [s], once
  double seconds = 0.0;  ///< a frame
  std::uint64_t bytes = 0;
};

/// Bakes a state as the first frame, for nobody: what that takes is what each frame like it takes.
/// Throws as BakeOutputs does.
[[nodiscard]] BakeCost measure_bake(const Job& job, const mpm::Scene& scene,
                                    const mpm::FrameState& state, Arena& arena,
                                    const Interrupter& interrupter);

}  // namespace matterfit::job
