// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "job/documents/json_reader.hpp"

namespace matterfit::job {

/// What a capture by images is like: cameras, times, sizes, how much of its images the body covers,
/// what is missing; `text` one finding a line, `places` the cameras' poses in the world. `options`
/// are the keys of a job's capture. Reads every image. Throws Error(kInput).
[[nodiscard]] Json image_summary(const std::filesystem::path& cameras, const Json& options);

}  // namespace matterfit::job
