// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/colour_key.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>

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
  const BodyMatte matte = keyed_matte(scene(), key);
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
  const BodyMatte matte = keyed_matte(image, key);
  const auto at = [&](int x, int y) {
    return int(matte.alpha[10 * std::size_t(y) + std::size_t(x)]);
  };
  EXPECT_EQ(at(3, 3), 255);
  EXPECT_EQ(at(9, 7), 0);
  EXPECT_EQ(at(2, 6), 0) << "the wall beside the body";
  EXPECT_NEAR(at(6, 3), 128, 12) << "half covered";
  EXPECT_EQ(matte.kept, 1.0);
}

/// Edges covered by a share, each side of the body before another background.
TEST(ColourKey, TheEdgeCoversWhatItCovers) {
  const std::array<int, 3> body = {0, 60, 120};
  const std::array<int, 3> wall = {120, 150, 180};  // half of the body's chroma, and brighter
  const std::array<int, 3> floor = {90, 90, 90};
  for (const double covered : {0.2, 0.5, 0.8}) {
    Bitmap image(40, 40);
    const auto mixed = [&](const std::array<int, 3>& behind) {
      std::array<std::uint8_t, 3> colour{};
      for (std::size_t c = 0; c < 3; ++c) {
        colour[c] =
            static_cast<std::uint8_t>(std::lround(covered * body[c] + (1.0 - covered) * behind[c]));
      }
      return colour;
    };
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 40; ++x) {
        const std::array<int, 3>& behind = y < 14 ? wall : floor;
        const bool inside = x >= 10 && x < 30 && y >= 10 && y < 30;
        const bool edge = !inside && x >= 9 && x <= 30 && y >= 9 && y <= 30;
        const std::array<int, 3>& flat = inside ? body : behind;
        set(image, x, y,
            edge ? mixed(behind)
                 : std::array<std::uint8_t, 3>{std::uint8_t(flat[0]), std::uint8_t(flat[1]),
                                               std::uint8_t(flat[2])});
      }
    }
    set(image, 31, 31, {0, 60, 120});  // meets the edge's corner alone
    ColourKey key;
    key.colour = Vec3d(0, 60, 120) / 255.0;
    key.range = {0.0, 1.0};
    const BodyMatte matte = keyed_matte(image, key);
    double area = 0.0;
    for (const std::uint8_t value : matte.alpha) area += value / 255.0;
    EXPECT_NEAR(area, 400.0 + 84.0 * covered, 3.0) << covered;
  }
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
