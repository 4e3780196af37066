// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "job/documents/json_reader.hpp"

namespace matterfit::job::page {

/// The residual over the frames of each recording, before and with the causes named, above what
/// noise and solver make; parts of the body that are wrong below it. HTML with SVG in it.
[[nodiscard]] std::string residual_charts(const Json& report);

/// When the evidence for a cause arrives: its score over the frames of each recording that has any.
[[nodiscard]] std::string evidence_charts(const Json& cause);

}  // namespace matterfit::job::page
