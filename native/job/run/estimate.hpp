// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "job/documents/document.hpp"
#include "job/run/run_options.hpp"

namespace matterfit::job {

/// Particles, bytes and a guess of the time that a job needs, without running it. `closely`: a
/// coarse copy of it is run first, for about a second.
[[nodiscard]] Json estimate_job(const Job& job, const RunOptions& options, bool closely);

}  // namespace matterfit::job
