// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <map>
#include <string>
#include <vector>

#include "job/documents/document.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {

/// What a result depends on: leaves of the document by their JSON path, file names replaced by the
/// hash of the file's content. Two jobs with equal inputs have equal results, wherever their files
/// lie.
using Inputs = std::map<std::string, std::string>;

/// Everything that the states depend on: the scene without its notes and limits, the files it
/// names, this library's version and the SIMD target. Reads each file once; throws Error(kInput) if
/// one is missing.
[[nodiscard]] Inputs simulation_inputs(const Job& job, mpm::SimdTarget target);

/// The captures with the contents of their files. Throws Error(kInput) if a file is missing.
[[nodiscard]] Inputs capture_inputs(const Job& job);

/// Everything that a fit depends on: the scene, the captures with the contents of their files, and
/// the section `fit`. Throws Error(kInput) if a file is missing.
[[nodiscard]] Inputs fit_inputs(const Job& job, mpm::SimdTarget target);

/// Everything that the baked files depend on beyond the states.
[[nodiscard]] Inputs output_inputs(const Job& job);

/// Throws Error(kInput) naming the first file of the document that is not there.
void require_files(const Job& job);

[[nodiscard]] std::string hash_inputs(const Inputs& inputs);

/// Lines such as "scene.gravity[2]: -9.81, was -3.7", at most `limit`, then "… and 12 more".
[[nodiscard]] std::vector<std::string> changes(const Inputs& before, const Inputs& now,
                                               std::size_t limit = 12);

/// "sse4", "avx2", "avx512"; kAuto resolved to the best that this machine has.
[[nodiscard]] std::string target_name(mpm::SimdTarget target);
/// Throws Error(kInput) listing the names ("auto" among them), or that this machine cannot run it.
[[nodiscard]] mpm::SimdTarget target_from_name(const std::string& name);
[[nodiscard]] mpm::SimdTarget resolve_target(mpm::SimdTarget target);

}  // namespace matterfit::job
