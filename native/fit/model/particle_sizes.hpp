// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "fit/model/image_problem.hpp"

namespace matterfit::fit {

/// A particle's size where no image determines it [particle separations]: neighbours overlap, and
/// an outline stands half a separation outside its particles.
inline constexpr double kUsualSize = 0.4;

/// The size of the particles with which a sighting of each camera covers as much of its image as
/// the matte does: what a Gaussian's soft edge adds to a body, and what matting takes from it, is
/// then in no residual but as a constant. It is one that is not held out, of the first frame, which
/// no material and no throw has changed; for a film without any, the first that shows the body
/// whole, else the one that shows most of it. Sets the size in all sightings of that camera. A
/// camera without one takes the mean of its film's others. So does one whose pose is fitted
/// (`moved`, by film and camera; empty: none is), for its area depends on how near it stands: the
/// mean of those that stay or, where none does, of all; where none has a size, kUsualSize.
/// Sightings of splats alone have no size to find. `names` of the films begin messages. `film`
/// draws what it is given, of its first query. Throws what that does, and Error(kInput) naming the
/// camera that sees nothing of the body where its matte does, or whose matte no size explains; with
/// `faults` that is said there, and the camera takes the mean.
void settle_sizes(const std::function<void(const Filming&)>& film,
                  const std::vector<std::string>& names,
                  const std::vector<std::vector<std::uint8_t>>& moved,
                  std::vector<Sighting>& sightings, std::vector<std::string>* faults = nullptr);

}  // namespace matterfit::fit
