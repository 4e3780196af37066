// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "job/documents/document.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// The coarser resolutions at which a fit of these scenes is worth beginning, as multiples of their
/// particle separation, coarse first; the last is 1. One halves the resolution where the bodies are
/// many particles and keep three cells across.
[[nodiscard]] std::vector<double> usual_levels(const std::vector<mpm::Scene>& scenes);

/// The job's scene with its particle separation times `level`, above 1; particles that were
/// imported are thinned. Throws Error(kInput), Error(kCancelled).
[[nodiscard]] mpm::Scene scene_at_level(const Job& job, double level, Arena& arena,
                                        const Interrupter& interrupter);

}  // namespace matterfit::job
