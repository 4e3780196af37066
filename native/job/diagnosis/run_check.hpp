// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/interrupter.hpp"
#include "job/documents/document.hpp"
#include "job/run/run_options.hpp"

namespace matterfit::job {

inline constexpr const char* kCheckSchema = "matterfit.check/1";

/// Reports before a fit what it can identify (diagnose/identify.hpp), at the values that it would
/// begin with: which parameters and how well, which are tied, whether frame rate, duration and
/// noise suffice, what a wrong assumption would do. Writes `check.json` into the output folder and
/// returns it (docs/formats.md, "check"). A handful of simulations; nothing else in the folder
/// changes. Throws Error of every kind.
[[nodiscard]] Json run_check(const Job& job, const RunOptions& options, Interrupter& interrupter);

}  // namespace matterfit::job
