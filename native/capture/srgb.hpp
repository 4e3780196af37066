// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

/// What displays show and light itself: the only place where the one becomes the other. Source: IEC
/// 61966-2-1 (sRGB).
namespace matterfit::capture {

/// Light, 0 to 1, of a value as displays show it, 0 to 1.
[[nodiscard]] inline double linear_of_srgb(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

/// The inverse; light beyond 0 to 1 is cut off.
[[nodiscard]] inline double srgb_of_linear(double light) {
  const double cut = std::clamp(light, 0.0, 1.0);
  return cut <= 0.0031308 ? 12.92 * cut : 1.055 * std::pow(cut, 1.0 / 2.4) - 0.055;
}

/// linear_of_srgb() of each value of eight bits.
[[nodiscard]] inline const std::array<float, 256>& linear_of_bytes() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = static_cast<float>(linear_of_srgb(double(i) / 255.0));
    }
    return values;
  }();
  return table;
}

/// Eight bits of light; what is not a number is 0.
[[nodiscard]] inline std::uint8_t byte_of_linear(double light) {
  return std::isnan(light) ? std::uint8_t{0}
                           : static_cast<std::uint8_t>(std::lround(255.0 * srgb_of_linear(light)));
}

}  // namespace matterfit::capture
