// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/overlay.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>

#include "base/error.hpp"

namespace matterfit::bake {
namespace {

using Colour = std::array<std::uint8_t, 4>;  ///< sRGB and alpha

constexpr Colour kOutside{255, 128, 0, 200};
constexpr Colour kMissing{0, 110, 255, 200};
constexpr Colour kBoth{255, 255, 255, 40};
constexpr Colour kInk{255, 255, 255, 255};
constexpr Colour kPaper{0, 0, 0, 160};

constexpr int kGlyphWidth = 3;
constexpr int kGlyphHeight = 5;
/// Rows from the top, three bits each, the left one highest.
constexpr std::string_view kGlyphs = "0123456789.-";
constexpr std::array<std::array<int, kGlyphHeight>, 12> kRows = {{
    {7, 5, 5, 5, 7},
    {2, 6, 2, 2, 7},
    {7, 1, 7, 4, 7},
    {7, 1, 7, 1, 7},
    {5, 5, 7, 1, 1},
    {7, 4, 7, 1, 7},
    {7, 4, 7, 5, 7},
    {7, 1, 1, 1, 1},
    {7, 5, 7, 5, 7},
    {7, 5, 7, 1, 7},
    {0, 0, 0, 0, 2},
    {0, 0, 7, 0, 0},
}};

void set(capture::Bitmap& bitmap, int x, int y, const Colour& colour) {
  if (x < 0 || y < 0 || x >= bitmap.width || y >= bitmap.height) return;
  const std::size_t at = std::size_t(y) * std::size_t(bitmap.width) + std::size_t(x);
  std::copy(colour.begin(), colour.end(), bitmap.rgba.begin() + std::ptrdiff_t(4 * at));
}

void write(capture::Bitmap& bitmap, const std::string& text) {
  const int scale = std::max(1, bitmap.height / 120);
  const int step = scale * (kGlyphWidth + 1);
  const int top = bitmap.height - scale * (kGlyphHeight + 2);
  const int right = scale + step * static_cast<int>(text.size());
  for (int y = top; y < bitmap.height; ++y) {
    for (int x = 0; x < right; ++x) set(bitmap, x, y, kPaper);
  }
  for (std::size_t k = 0; k < text.size(); ++k) {
    const std::size_t glyph = kGlyphs.find(text[k]);
    if (glyph == std::string_view::npos) continue;
    for (int y = 0; y < scale * kGlyphHeight; ++y) {
      for (int x = 0; x < scale * kGlyphWidth; ++x) {
        const int row = kRows[glyph][std::size_t(y / scale)];
        if ((row >> (kGlyphWidth - 1 - x / scale) & 1) == 0) continue;
        set(bitmap, scale + step * static_cast<int>(k) + x, top + scale + y, kInk);
      }
    }
  }
}

}  // namespace

capture::Bitmap overlay(std::span<const float> mask, std::span<const std::uint8_t> covered,
                        int width, int height, const std::string& text) {
  capture::Bitmap bitmap(width, height);
  bitmap.has_alpha = true;
  if (mask.size() != bitmap.pixels() || covered.size() != bitmap.pixels()) {
    throw_input("an overlay of masks of different sizes.");
  }
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const bool ours = mask[i] >= 0.5F;
    const bool theirs = covered[i] != 0;
    if (!ours && !theirs) continue;
    const Colour& colour = ours && theirs ? kBoth : (ours ? kOutside : kMissing);
    std::copy(colour.begin(), colour.end(), bitmap.rgba.begin() + std::ptrdiff_t(4 * i));
  }
  write(bitmap, text);
  return bitmap;
}

}  // namespace matterfit::bake
