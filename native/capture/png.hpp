// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace matterfit::capture {

/// An image of 8 bits a channel, as displays show it (sRGB), its alpha not multiplied in.
/// Row-major, row 0 on top.
struct Bitmap {
  int width = 0;
  int height = 0;
  bool has_alpha = false;          ///< the file had one; without, alpha is 255
  bool was_light = false;          ///< colours were linear in light, and are coded as sRGB here
  std::vector<std::uint8_t> rgba;  ///< (height, width, 4)

  Bitmap() = default;
  Bitmap(int image_width, int image_height);  ///< transparent black
  [[nodiscard]] std::size_t pixels() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
};

/// Longest edge that is read [pixels].
inline constexpr int kMostImageEdge = 1 << 14;

/// Any PNG: grey, palette, 16 bits (rounded to 8). Throws Error(kInput) beginning with `name`.
[[nodiscard]] Bitmap parse_png(std::span<const std::byte> bytes, const std::string& name);
[[nodiscard]] Bitmap read_png(const std::filesystem::path& path);

/// Width and height, from the head alone. Throws Error(kInput).
[[nodiscard]] std::array<int, 2> png_size(std::span<const std::byte> bytes,
                                          const std::string& name);

/// RGBA where `bitmap.has_alpha`, else RGB; the same bytes for the same pixels and zlib. Throws
/// Error(kOutput).
void write_png(const std::filesystem::path& path, const Bitmap& bitmap);

}  // namespace matterfit::capture
