// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "fit/data/capture.hpp"
#include "mpm/scene.hpp"

/// What a recording is good for: its noise, and whether it is of that body.
namespace matterfit::fit {

/// σ of every point: what was given; where that is 0 or missing the capture's own estimate from
/// samples that are not held out, where there is none, and for clouds, 1e-3 of the body's size.
void settle_noise(std::vector<Capture>& captures, const mpm::Scene& scene,
                  std::vector<std::string>& statements);

/// States of each cloud how it is compared, and what its points alone make of that; noise settled.
void describe_clouds(const std::vector<Capture>& captures, std::vector<std::string>& statements);

/// Whether a capture can be of this body: where more than 5 % of its points lie farther than two
/// particle separations off it at rest there is a statement; beyond a quarter of the body's size as
/// well Error(kInput).
void check_places(const std::vector<Capture>& captures, const mpm::Scene& scene, Arena& arena,
                  std::vector<std::string>& statements);

}  // namespace matterfit::fit
