// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace matterfit::capture {

/// A point cache (PC2): header of 32 bytes "POINTCACHE2\0", int32 version 1, int32 points, float32
/// start frame, float32 frames between samples, int32 samples; then samples × points × 3 float32,
/// little endian.
struct PointCache {
  std::size_t points = 0;
  std::size_t samples = 0;
  float start_frame = 0.0F;
  float sample_rate = 1.0F;      ///< frames from one sample to the next
  std::vector<float> positions;  ///< (samples, points, 3), the file's own units
};

/// Throws Error(kInput) naming offset and reason; the size must be exactly what the header says.
[[nodiscard]] PointCache parse_pc2(std::span<const std::byte> bytes, const std::string& name);
[[nodiscard]] PointCache read_pc2(const std::filesystem::path& path);

}  // namespace matterfit::capture
