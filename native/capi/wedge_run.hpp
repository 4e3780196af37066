// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "capi/job_thread.hpp"
#include "job/documents/wedge.hpp"

namespace matterfit::capi {

/// Runs the members of a wedge, `at_once` of them side by side, on options.threads threads in all
/// (0: as many as the machine has). A member whose folder holds the complete results of the same
/// inputs is skipped; one that was stopped goes on. A member that fails does not stop the others.
///
/// The result: {"status", "folder", "members": [{"folder", "label", "status": "done" | "done
/// before" | "failed" | "cancelled" | "waiting", "seconds", "error"?}]}. The exit status is 130
/// after `interrupter` was cancelled, else that of the first member that failed, else 0.
[[nodiscard]] Outcome run_wedge(const job::WedgeFolder& wedge, const job::RunOptions& options,
                                int at_once, Interrupter& interrupter);

/// The result as a table for people, a line a member.
[[nodiscard]] std::string wedge_table(const job::Json& result);

}  // namespace matterfit::capi
