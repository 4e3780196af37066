// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/colour_key.hpp"

#include <gtest/gtest.h>

#include <array>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

void set(Bitmap& image, int x, int y, const std::array<std::uint8_t, 3>& colour) {
  for (std::size_t c = 0; c < 3; ++c) {
    image.rgba[4 * (std::size_t(y) * std::size_t(image.width) + std::size_t(x)) + c] = colour[c];
  }
}

/// A blue square of 4 × 4 pixels on grey, a lone blue pixel, a red one beside the square, and a
/// pixel of the square's edge that it covers by half.
Bitmap scene() {
  Bitmap image(10, 8);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 10; ++x) set(image, x, y, {90, 90, 90});
  }
  for (int y = 2; y < 6; ++y) {
    for (int x = 2; x < 6; ++x) set(image, x, y, {0, 100, 200});
  }
  set(image, 6, 3, {45, 95, 145});
  set(image, 2, 1, {200, 60, 40});
  set(image, 9, 7, {0, 100, 200});
  return image;
}

TEST(ColourKey, TheLargestRegionOfTheColourIsTheMatte) {
  ColourKey key;
  key.colour = Vec3d(0, 100, 200) / 255.0;
  key.range = {0.0, 1.0};
  const KeyedMatte matte = keyed_matte(scene(), key);
  EXPECT_NEAR(matte.kept, 16.0 / 17.0, 1e-12) << "the square, and a lone pixel";
  const auto at = [&](int x, int y) {
    return int(matte.alpha[10 * std::size_t(y) + std::size_t(x)]);
  };
  EXPECT_EQ(at(2, 2), 255);
  EXPECT_EQ(at(5, 5), 255);
  EXPECT_EQ(at(0, 0), 0);
  EXPECT_EQ(at(2, 1), 0) << "another colour";
  EXPECT_EQ(at(9, 7), 0) << "another region";
  EXPECT_NEAR(at(6, 3), 128, 2) << "half covered";
}

/// The wall has as much of the key's chroma as a third of the body, and more pixels.
TEST(ColourKey, ABrightWallWithATintIsNoDarkBody) {
  Bitmap image = scene();
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 10; ++x) {
      const bool body = x >= 2 && x < 6 && y >= 2 && y < 6;
      set(image, x, y,
          body ? std::array<std::uint8_t, 3>{0, 30, 60}
               : std::array<std::uint8_t, 3>{200, 220, 240});
    }
  }
  set(image, 6, 3, {100, 125, 150});  // half of each
  ColourKey key;
  key.colour = Vec3d(0, 30, 60) / 255.0;
  const KeyedMatte matte = keyed_matte(image, key);
  const auto at = [&](int x, int y) {
    return int(matte.alpha[10 * std::size_t(y) + std::size_t(x)]);
  };
  EXPECT_EQ(at(3, 3), 255);
  EXPECT_EQ(at(9, 7), 0);
  EXPECT_EQ(at(2, 6), 0) << "the wall beside the body";
  EXPECT_NEAR(at(6, 3), 128, 12) << "half covered";
  EXPECT_EQ(matte.kept, 1.0);
}

TEST(ColourKey, AGreyKeyAndARangeThatFallsAreRefused) {
  ColourKey key;
  key.colour = Vec3d(0.5, 0.5, 0.5);
  EXPECT_THROW((void)keyed_matte(scene(), key), Error);
  key.colour = Vec3d(0, 0, 1);
  key.range = {0.6, 0.6};
  EXPECT_THROW((void)keyed_matte(scene(), key), Error);
}

}  // namespace
}  // namespace matterfit::capture
