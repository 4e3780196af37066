// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

namespace matterfit::capture {

/// Clears what is not of the largest region of pixels above ½ (those that share an edge), or beside
/// it. `matte` 0 to 255, row-major. Returns the share of such pixels that the region has; 1 without
/// any.
double keep_largest_region(std::vector<std::uint8_t>& matte, int width, int height);

/// How far each pixel lies from those of a region above ½, along x or y, whichever is more; more
/// than `most` is one value.
[[nodiscard]] std::vector<int> distances_from(const std::vector<std::uint8_t>& region, int width,
                                              int height, int most);

}  // namespace matterfit::capture
