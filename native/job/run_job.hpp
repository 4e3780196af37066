// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/interrupter.hpp"
#include "job/documents/document.hpp"
#include "job/run/run_options.hpp"

namespace matterfit::job {

/// Runs a job to its end: simulate, compare or bake. What the output folder already holds of the
/// same inputs is used; an unfinished run goes on from its last checkpoint and gives the bytes of
/// an unbroken one. Where the folder holds results of other inputs, Error(kInput) lists what
/// changed, unless `restart` says otherwise. Returns the result that the tool prints
/// (docs/formats.md). Throws Error of every kind; whatever happens, no half-written file stands
/// under a final name.
[[nodiscard]] Json run_job(const Job& job, const RunOptions& options, Interrupter& interrupter);

}  // namespace matterfit::job
