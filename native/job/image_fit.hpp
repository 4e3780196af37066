// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/interrupter.hpp"
#include "job/documents/document.hpp"
#include "job/run/run_options.hpp"

namespace matterfit::job {

/// Fits a job's parameters to captures by images, then simulates the fitted scene (docs/formats.md,
/// "images"). The search begins at coarse values of stiffness where none is given, leads from wide
/// blurs to narrow ones, and ends with errors as other fits do. Throws Error of every kind.
[[nodiscard]] Json run_image_fit(const Job& job, const RunOptions& options,
                                 Interrupter& interrupter);

}  // namespace matterfit::job
