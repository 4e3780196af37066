// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/vec.hpp"

namespace matterfit::capture {

/// A capture: how points of a body moved. Metres, seconds, Z up after reading.
struct Tracks {
  std::size_t points = 0;               ///< N
  std::vector<double> times;            ///< (T,) [s], strictly ascending, from the file
  std::vector<Vec3d> positions;         ///< (T, N) frame-major; NaN where not visible
  std::vector<std::uint8_t> visible;    ///< (T, N) or empty: all visible
  std::vector<double> noise;            ///< standard deviation [m]: empty, one, or N values
  std::vector<std::string> labels;      ///< marker names, or empty
  std::string source;                   ///< file it came from

  [[nodiscard]] std::size_t frames() const { return times.size(); }
  [[nodiscard]] const Vec3d& position(std::size_t frame, std::size_t point) const {
    return positions[frame * points + point];
  }
  [[nodiscard]] bool is_visible(std::size_t frame, std::size_t point) const {
    return visible.empty() || visible[frame * points + point] != 0;
  }
};

}  // namespace matterfit::capture
