// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <optional>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "job/documents/document.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {

/// How a job's later frames differ from its first substep: contact shortens substeps, a splash
/// costs more than what rests.
struct Rehearsal {
  double substeps = 0.0;  ///< of all frames of the job, at its own resolution
  double dearer = 1.0;    ///< cost of a substep, mean of all over the first
  double baking = 1.0;    ///< cost of baking a frame, mean of first and last over the first
  double size = 1.0;      ///< bytes of a frame, likewise
};

/// Runs the job with few particles, for `seconds` of wall clock at most; what it did not get to
/// goes on as its last frames did. A substep grows with the particle separation. Nothing where the
/// coarse job fails, or got nowhere. `particles`: of the job itself. Throws Error(kCancelled).
[[nodiscard]] std::optional<Rehearsal> rehearse(const Job& job, std::size_t particles,
                                                double seconds, mpm::SimdTarget target,
                                                const std::shared_ptr<Arena>& arena,
                                                const Interrupter& interrupter);

}  // namespace matterfit::job
