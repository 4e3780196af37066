// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace matterfit::capture {

/// Coverage from which on a pixel is of a region.
inline constexpr std::uint8_t kHalfCovered = 128;

/// A matte that was made of an image.
struct BodyMatte {
  std::vector<std::uint8_t> alpha;  ///< of each pixel, 0 to 255, row-major
  double kept = 1.0;                ///< share of the body's pixels that the largest region has
};

/// Clears what is not of the largest region of pixels above ½ (those that share an edge), or beside
/// it. `matte` 0 to 255, row-major. Returns the share of such pixels that the region has; 1 without
/// any.
double keep_largest_region(std::vector<std::uint8_t>& matte, int width, int height);

/// Calls visit(place) for the pixels that share an edge with one, `place` in an image's rows.
template <class Visit>
void for_neighbours(std::size_t place, int width, int height, const Visit& visit) {
  const auto w = static_cast<std::size_t>(width);
  if (place % w > 0) visit(place - 1);
  if (place % w + 1 < w) visit(place + 1);
  if (place >= w) visit(place - w);
  if (place + w < w * static_cast<std::size_t>(height)) visit(place + w);
}

}  // namespace matterfit::capture
