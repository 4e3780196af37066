// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/interrupter.hpp"
#include "job/documents/document.hpp"
#include "job/run/run_options.hpp"

namespace matterfit::job {

inline constexpr const char* kReportSchema = "matterfit.report/1";

/// Fits a job as the task `fit` does (or takes the fit of the same inputs that
/// the output folder holds), then asks what the fitted simulation gets wrong
/// (diagnose/diagnose.hpp). Writes `diagnosis.json`, `diagnosis.html` and,
/// where a cause of the simulation is accepted, `extended.json`, the model with
/// it as a job. Returns the report (docs/formats.md, "diagnose"). Throws Error
/// of every kind.
[[nodiscard]] Json run_diagnose(const Job& job, const RunOptions& options,
                                Interrupter& interrupter);

}  // namespace matterfit::job
