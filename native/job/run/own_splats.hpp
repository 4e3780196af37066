// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "capture/splats.hpp"
#include "fit/model/own_splats.hpp"
#include "job/documents/document.hpp"

namespace matterfit::job {

/// The splats of a file in the frame of a body's source, cropped in it, where the body starts.
/// Throws Error(kInput).
[[nodiscard]] capture::Splats placed_splats(const std::filesystem::path& file,
                                            const std::optional<Eigen::AlignedBox3d>& crop,
                                            const Placement& placement);

/// What bodies are drawn by that are not drawn by their particles: their `output.splats` or,
/// without any, the splats of which they were filled. Throws Error(kInput) beginning with the JSON
/// path.
[[nodiscard]] std::vector<fit::BodySplats> own_splats(const Job& job);

}  // namespace matterfit::job
