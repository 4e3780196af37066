// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "capture/tracks.hpp"

namespace matterfit::capture {

/// From sample `frame` on two tracks go on as each other: a tracker took one for the other.
struct Swap {
  std::size_t frame = 0;
  std::size_t first = 0;
  std::size_t second = 0;
  friend bool operator==(const Swap&, const Swap&) = default;
};

/// Tracks that change places between two samples. The motion from one sample to the next is taken
/// for an affine map of the places (robust: the worst fifth is left out of it), so at least 15
/// tracks must be seen in both; two of them are exchanged where that brings their distances from
/// the map to a third at most, and those are larger than the others' and than noise. Tracks that
/// change back are two swaps. Ascending by frame.
[[nodiscard]] std::vector<Swap> find_swaps(const Tracks& tracks);

/// Exchanges the samples of two tracks from each swap's frame on. Throws Error(kInput) for one that
/// names a frame or a track that is not there.
void apply_swaps(const std::vector<Swap>& swaps, Tracks& tracks);

}  // namespace matterfit::capture
