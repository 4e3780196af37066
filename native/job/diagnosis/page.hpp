// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "job/documents/json_reader.hpp"

namespace matterfit::job {

/// A report (`matterfit.report/1`, docs/formats.md) as one HTML page that needs
/// no other file and no network: verdict, table of causes, the residual over
/// the frames with the noise and the grid below it, what could not be seen, and
/// what to record next. Every number in it is the report's. Readable on a
/// phone; equal reports give equal bytes.
[[nodiscard]] std::string report_page(const Json& report);

}  // namespace matterfit::job
