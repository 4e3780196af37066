// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "job/documents/document.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// The job's scene with its particle separation times `level`, above 1; particles that were
/// imported are thinned. Throws Error(kInput), Error(kCancelled).
[[nodiscard]] mpm::Scene scene_at_level(const Job& job, double level, Arena& arena,
                                        const Interrupter& interrupter);

}  // namespace matterfit::job
