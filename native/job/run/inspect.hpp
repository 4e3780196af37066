// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "job/documents/json_reader.hpp"

namespace matterfit::job {

/// What a cache folder holds: result hash computed from its files, frames, and every file that is
/// missing, truncated or changed. Throws Error(kInput) if the folder has no manifest.
[[nodiscard]] Json inspect_folder(const std::filesystem::path& folder);

/// What a capture is like: the summary of capture/check.hpp as JSON. `options` are the keys of a
/// job's capture (`unit`, `up`, `fps`, `markers`, …); with `cameras`, or of a .json file or a
/// COLMAP model, it is one by images (job/run/image_summary.hpp).
[[nodiscard]] Json capture_summary(const std::filesystem::path& path, const Json& options);

/// The same of a recording without options, or, of a file of splats, how many there are, how large,
/// how opaque and where: `text` one finding a line. Throws Error(kInput).
[[nodiscard]] Json file_summary(const std::filesystem::path& path);

}  // namespace matterfit::job
