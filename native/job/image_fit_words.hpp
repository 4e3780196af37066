// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "fit/model/image_problem.hpp"
#include "job/documents/json_reader.hpp"

namespace matterfit::job {

/// Agreement of outlines before and after a fit (image_sightings.hpp, silhouettes_json), in words,
/// for who sees no numbers of it elsewhere.
[[nodiscard]] std::string outlines_text(const Json& before, const Json& after);

/// Where one kind of recording is missed by far more of its noise than the other it is given too
/// much weight; empty where not.
[[nodiscard]] std::string weights_text(const fit::ImageProblem::Misfit& misfit);

}  // namespace matterfit::job
