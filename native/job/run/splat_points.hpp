// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "job/documents/json_reader.hpp"

namespace matterfit::job {

/// Writes what a viewport shows of a file of splats as `npz`, in the file's own frame: `positions`
/// (N,3), `rotations` (N,4) w first, `scales` (N,3) standard deviations, `colours` (N,3) of
/// harmonic 0 (sRGB, 0 to 1), `opacities` (N). `options`: `opacity_threshold` (0), and `most`
/// (20000), to which the splats are thinned evenly in their order. Returns `gaussians` (in the
/// file), `kept` (opaque enough), `written`, `low` and `high` (of the centres of those that are
/// kept). Throws Error of kinds kInput and kOutput.
[[nodiscard]] Json write_splat_points(const std::filesystem::path& path, const Json& options,
                                      const std::filesystem::path& npz);

}  // namespace matterfit::job
