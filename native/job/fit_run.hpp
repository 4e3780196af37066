// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/interrupter.hpp"
#include "job/run/run_options.hpp"

namespace matterfit::job {

/// Fits a job's parameters to its captures, then simulates and compares the fitted scene
/// (docs/formats.md, "fit"). Goes on from `fit/checkpoint.json` of the same inputs with the bits of
/// an unbroken fit; a fit that is finished is not done again. Cancelled, it writes and returns the
/// best so far, `status` "cancelled". Throws Error of every kind.
[[nodiscard]] Json run_fit(const Job& job, const RunOptions& options, Interrupter& interrupter);

}  // namespace matterfit::job
