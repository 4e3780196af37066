// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/dot_splat.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/byte_reader.hpp"
#include "capture/spherical_harmonics.hpp"

namespace matterfit::capture {
namespace {

constexpr std::size_t kRow = 32;
constexpr float kSmallestScale = 1e-9F;  // [m]: PLY files hold its logarithm

[[noreturn]] void refuse(const std::string& name, std::size_t row, const std::string& reason) {
  throw_input(name + ": row " + std::to_string(row) + ": " + reason);
}

float byte_at(std::span<const std::byte> row, std::size_t at) {
  return static_cast<float>(std::to_integer<std::uint8_t>(row[at]));
}

std::byte to_byte(float value) {
  return static_cast<std::byte>(
      static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0F, 255.0F))));
}

}  // namespace

Splats parse_dot_splat(std::span<const std::byte> bytes, const std::string& name) {
  if (bytes.empty() || bytes.size() % kRow != 0) {
    throw_input(name + ": has " + std::to_string(bytes.size()) +
                " bytes, expected 32 a Gaussian. Is it truncated, or another format?");
  }
  const std::size_t count = bytes.size() / kRow;
  Splats splats;
  splats.means.resize(count);
  splats.scales.resize(count);
  splats.rotations.resize(count);
  splats.opacities.resize(count);
  splats.sh.resize(3 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto row = bytes.subspan(i * kRow, kRow);
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = 4 * static_cast<std::size_t>(axis);
      splats.means[i][axis] = load<float>(row.data() + at);
      const float scale = load<float>(row.data() + 12 + at);
      if (!std::isfinite(scale) || scale < 0.0F) {
        refuse(name, i,
               "a scale is " + std::to_string(scale) +
                   ", expected 0 or more. Scales are linear in .splat files.");
      }
      splats.scales[i][axis] = std::max(scale, kSmallestScale);
    }
    if (!splats.means[i].allFinite()) refuse(name, i, "the position is not finite.");
    for (std::size_t c = 0; c < 3; ++c) {
      splats.sh[3 * i + c] = (byte_at(row, 24 + c) / 255.0F - 0.5F) / kShBand0;
    }
    splats.opacities[i] = byte_at(row, 27) / 255.0F;
    std::array<float, 4> q;
    for (std::size_t k = 0; k < 4; ++k) q[k] = (byte_at(row, 28 + k) - 128.0F) / 128.0F;
    const Eigen::Quaternionf rotation(q[0], q[1], q[2], q[3]);
    if (!(rotation.norm() > 0.0F)) refuse(name, i, "the rotation is zero.");
    splats.rotations[i] = rotation.normalized();
  }
  return splats;
}

void write_dot_splat(const std::filesystem::path& path, const Splats& splats) {
  std::vector<std::byte> bytes(splats.size() * kRow);
  const std::size_t stride = 3 * splats.sh_bands();
  for (std::size_t i = 0; i < splats.size(); ++i) {
    std::byte* row = bytes.data() + i * kRow;
    std::memcpy(row, splats.means[i].data(), 12);
    std::memcpy(row + 12, splats.scales[i].data(), 12);
    for (std::size_t c = 0; c < 3; ++c) {
      row[24 + c] = to_byte(255.0F * (0.5F + kShBand0 * splats.sh[i * stride + c]));
    }
    row[27] = to_byte(255.0F * splats.opacities[i]);
    const Eigen::Quaternionf& q = splats.rotations[i];
    const std::array<float, 4> wxyz = {q.w(), q.x(), q.y(), q.z()};
    for (std::size_t k = 0; k < 4; ++k) row[28 + k] = to_byte(128.0F * wxyz[k] + 128.0F);
  }
  write_file(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace matterfit::capture
