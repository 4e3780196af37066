// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

namespace matterfit::capi {

/// `matterfit inspect`: prints what a folder of results, or a file of a recording or of splats,
/// holds, as JSON with `json`, and writes it to `report` too where that is not empty. Returns the
/// exit status, 2 where files of the folder are damaged. Throws Error.
int inspect(const std::filesystem::path& path, const std::filesystem::path& report, bool json);

}  // namespace matterfit::capi
