// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "base/interrupter.hpp"
#include "job/cache.hpp"
#include "job/document.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {

struct RunOptions {
  int threads = 0;  ///< 0: as many as the machine has
  mpm::SimdTarget target = mpm::SimdTarget::kAuto;
  Restart restart = Restart::kNever;
};

/// Runs a job to its end: simulate, compare or bake. What the output folder already holds of the
/// same inputs is used; an unfinished run goes on from its last checkpoint and gives the bytes of
/// an unbroken one. Where the folder holds results of other inputs, Error(kInput) lists what
/// changed, unless `restart` says otherwise. Returns the result that the tool prints
/// (docs/formats.md). Throws Error of every kind; whatever happens, no half-written file stands
/// under a final name.
[[nodiscard]] Json run_job(const Job& job, const RunOptions& options, Interrupter& interrupter);

/// Particles, bytes and a guess of the time that a job needs, without running it.
[[nodiscard]] Json estimate_job(const Job& job, const RunOptions& options);

/// What a cache folder holds: result hash computed from its files, frames, and every file that is
/// missing, truncated or changed. Throws Error(kInput) if the folder has no manifest.
[[nodiscard]] Json inspect_folder(const std::filesystem::path& folder);

/// What a capture is like: the summary of capture/check.hpp as JSON. `options` are the keys of a
/// job's capture (`unit`, `up`, `fps`, `markers`, …).
[[nodiscard]] Json capture_summary(const std::filesystem::path& path, const Json& options);

}  // namespace matterfit::job
