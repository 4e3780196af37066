// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "diagnose/model.hpp"
#include "diagnose/report.hpp"
#include "job/documents/json_reader.hpp"

namespace matterfit::job {

/// JSON has no infinity: null stands for what is not finite.
[[nodiscard]] Json number_json(double value);

/// A report as `matterfit.report/1` (docs/formats.md). Lengths in metres,
/// shares from 0 to 1.
[[nodiscard]] Json report_json(const diagnose::Report& report,
                               const std::vector<diagnose::Capture>& captures);

}  // namespace matterfit::job
