// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/pc2.hpp"

#include <cmath>
#include <cstring>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/byte_reader.hpp"

namespace matterfit::capture {

PointCache parse_pc2(std::span<const std::byte> bytes, const std::string& name) {
  ByteReader reader(bytes, name);
  const auto magic = reader.take(12, "the signature");
  if (std::memcmp(magic.data(), "POINTCACHE2", 12) != 0) {
    throw_input(name + ": is not a PC2 point cache.");
  }
  const auto version = reader.read<std::int32_t>("the version");
  if (version != 1) {
    throw_input(name + ": has PC2 version " + std::to_string(version) + ", expected 1.");
  }
  const auto points = reader.read<std::int32_t>("the number of points");
  PointCache cache;
  cache.start_frame = reader.read<float>("the start frame");
  cache.sample_rate = reader.read<float>("the sample rate");
  const auto samples = reader.read<std::int32_t>("the number of samples");
  if (points <= 0 || samples <= 0) {
    throw_input(name + ": states " + std::to_string(points) + " points and " +
                std::to_string(samples) + " samples; both must be positive.");
  }
  if (!std::isfinite(cache.start_frame) || !(cache.sample_rate > 0.0F) ||
      !std::isfinite(cache.sample_rate)) {
    throw_input(name + ": states start frame " + std::to_string(cache.start_frame) +
                " and sample rate " + std::to_string(cache.sample_rate) +
                "; expected finite and positive numbers.");
  }
  // Both counts are below 2³¹, so neither product overflows 64 bits by more than is tested here.
  const auto values = static_cast<std::uint64_t>(points) * static_cast<std::uint64_t>(samples);
  if (values > reader.remaining() / 12 || values * 12 != reader.remaining()) {
    throw_input(name + ": states " + std::to_string(points) + " points in " +
                std::to_string(samples) + " samples of 12 bytes each, but " +
                std::to_string(reader.remaining()) + " bytes follow the header. " +
                (values > reader.remaining() / 12 ? "Is it truncated?"
                                                  : "Was it written by an unfinished bake?"));
  }
  cache.points = static_cast<std::size_t>(points);
  cache.samples = static_cast<std::size_t>(samples);
  cache.positions.resize(values * 3);
  const auto body = reader.take(values * 12, "the positions");
  std::memcpy(cache.positions.data(), body.data(), body.size());
  return cache;
}

PointCache read_pc2(const std::filesystem::path& path) {
  return parse_pc2(read_file(path), path.filename().string());
}

}  // namespace matterfit::capture
