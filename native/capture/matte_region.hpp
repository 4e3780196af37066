// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

namespace matterfit::capture {

/// Clears what is not of the largest region of pixels above ½ (those that share an edge), or beside
/// it. `matte` 0 to 255, row-major.
void keep_largest_region(std::vector<std::uint8_t>& matte, int width, int height);

}  // namespace matterfit::capture
