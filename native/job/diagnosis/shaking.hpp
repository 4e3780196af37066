// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "job/diagnosis/causes.hpp"

namespace matterfit::job {

/// A frame that shakes, which the body stands in: one shape a frequency, from two periods in the
/// longest recording (`duration` [s]) to a quarter of the scene's frame rate. Its numbers are the
/// parts of the frame's acceleration that go with the cosine and the sine of the time since the
/// first frame, three each [m/s²]. A steady acceleration is gravity's size and direction, and no
/// shape of this. Nothing where the scene has such an effect already, or fewer than ten frames.
[[nodiscard]] std::optional<Cause> shaking(const mpm::Scene& scene, double duration);

}  // namespace matterfit::job
