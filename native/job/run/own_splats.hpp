// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "capture/splats.hpp"
#include "fit/model/own_splats.hpp"
#include "job/documents/document.hpp"

namespace matterfit::job {

/// What an output keeps of its file, which is in the frame of the body's source, where the body
/// starts. Throws Error(kInput).
[[nodiscard]] capture::Splats placed_splats(const SplatOutput& splats, const Placement& placement);

/// What bodies are drawn by that are not drawn by their particles: their `output.splats` or,
/// without any, the splats of which they were filled. Throws Error(kInput) beginning with the JSON
/// path.
[[nodiscard]] std::vector<fit::BodySplats> own_splats(const Job& job);

}  // namespace matterfit::job
