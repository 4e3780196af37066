// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/overlay.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/error.hpp"

namespace matterfit::bake {
namespace {

using Pixel = std::array<int, 4>;

constexpr std::size_t kWide = 40;
constexpr std::size_t kPixels = kWide * 30;

Pixel pixel(const capture::Bitmap& bitmap, int x, int y) {
  const std::uint8_t* rgba =
      bitmap.rgba.data() + 4 * (std::ptrdiff_t(y) * bitmap.width + std::ptrdiff_t(x));
  return {rgba[0], rgba[1], rgba[2], rgba[3]};
}

TEST(Overlay, ShowsWhatIsOutsideAndWhatIsMissing) {
  std::vector<float> mask(kPixels, 0.0F);
  std::vector<std::uint8_t> covered(kPixels, 0);
  for (std::size_t i = 0; i < 40; ++i) {
    if (i < 20) mask[kWide * 2 + i] = 0.6F;
    if (i >= 10 && i < 30) covered[kWide * 2 + i] = 1;
    mask[kWide * 3 + i] = 0.4F;
  }
  const capture::Bitmap bitmap = overlay(mask, covered, 40, 30, "");
  EXPECT_EQ(pixel(bitmap, 5, 2), (Pixel{255, 128, 0, 200}));
  EXPECT_EQ(pixel(bitmap, 15, 2), (Pixel{255, 255, 255, 40}));
  EXPECT_EQ(pixel(bitmap, 25, 2), (Pixel{0, 110, 255, 200}));
  EXPECT_EQ(pixel(bitmap, 35, 2)[3], 0);
  EXPECT_EQ(pixel(bitmap, 5, 3)[3], 0) << "less than half of a pixel";
  EXPECT_THROW((void)overlay(mask, covered, 40, 29, ""), Error);
}

TEST(Overlay, TheFramesNumberStandsInTheCorner) {
  const std::vector<float> mask(kPixels, 0.0F);
  const std::vector<std::uint8_t> covered(kPixels, 0);
  const capture::Bitmap bitmap = overlay(mask, covered, 40, 30, "17");
  std::string rows;
  for (int y = 23; y < 30; ++y) {
    for (int x = 0; x < 10; ++x) {
      const Pixel at = pixel(bitmap, x, y);
      rows += at[3] == 0 ? ' ' : (at[0] == 255 ? '#' : '.');
    }
    rows += '\n';
  }
  EXPECT_EQ(rows,
            "......... \n"
            "..#..###. \n"
            ".##....#. \n"
            "..#....#. \n"
            "..#....#. \n"
            ".###...#. \n"
            "......... \n");
  // Wider than the image, and of what has no glyph, nothing breaks.
  EXPECT_EQ(overlay(std::vector<float>(4), std::vector<std::uint8_t>(4), 2, 2, "1x234").pixels(),
            4U);
}

}  // namespace
}  // namespace matterfit::bake
