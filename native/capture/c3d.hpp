// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "base/vec.hpp"

namespace matterfit::capture {

/// The points of a C3D file (www.c3d.org, user guide 2020). Analogue samples and events are
/// skipped.
struct C3d {
  std::size_t points = 0;
  std::size_t frames = 0;
  std::int64_t first_frame = 1;       ///< number of the first frame in the file
  double rate = 0.0;                  ///< POINT:RATE, or the header's [Hz]
  std::string units;                  ///< POINT:UNITS, "mm" or "m" mostly; may be empty
  std::vector<std::string> labels;    ///< POINT:LABELS (LABELS2 …), one a point
  std::vector<Vec3d> positions;       ///< (frames, points) in `units`; NaN where not visible
  std::vector<std::uint8_t> visible;  ///< (frames, points): residual ≥ 0
  std::vector<float> residuals;       ///< (frames, points) in `units`; −1 where not visible

  /// Metres per unit from `units`; 0 if it is empty or unknown.
  [[nodiscard]] double metres_per_unit() const;
};

/// Intel and MIPS byte order and DEC floating point; integer and float points; frame counts beyond
/// 65535 (POINT:FRAMES, TRIAL:ACTUAL_START_FIELD/ACTUAL_END_FIELD). Throws Error(kInput) naming
/// offset and reason.
[[nodiscard]] C3d parse_c3d(std::span<const std::byte> bytes, const std::string& name);
[[nodiscard]] C3d read_c3d(const std::filesystem::path& path);

}  // namespace matterfit::capture
