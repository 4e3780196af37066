// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "base/parallel.hpp"
#include "fit/data/track_motion.hpp"
#include "material/excitation.hpp"

namespace matterfit::fit {

/// What a share of the values, which are put into another order, stays within; 0 where there are
/// none.
[[nodiscard]] double within(std::vector<double>& values, double share);

/// The strains and rates that tracks show at `places` of a body at rest: of |dev ε| against rest,
/// of ln J both ways and of |dev D| between frames what 95 % of the places and frames stay within,
/// of the rates the middle one too; strains up to 1, volume strains up to .5. Noise of the tracks
/// is in it. Nothing where no place has tracks around it. `flows` as in track_motion(). Throws
/// Error(kInput) where there are fewer than two frames.
[[nodiscard]] std::optional<material::Excitation> excitation(const InteriorTracks& tracks,
                                                             const Points& places, bool flows,
                                                             Arena& arena);

}  // namespace matterfit::fit
