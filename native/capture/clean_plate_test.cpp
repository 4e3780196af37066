// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/clean_plate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/error.hpp"
#include "base/vec.hpp"
#include "capture/srgb.hpp"

namespace matterfit::capture {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 120;

/// A background with a slope and a coarse pattern [light].
Vec3d background(int x, int y) {
  const double slope = 0.1 + 0.3 * x / kWidth;
  const double pattern = (x / 20 + y / 15) % 2 == 0 ? 0.0 : 0.08;
  return {slope + pattern, slope, 0.5 * slope + pattern};
}

/// Coverage by a ball, of 16 × 16 samples in each pixel.
double coverage(int x, int y) {
  int inside = 0;
  for (int j = 0; j < 16; ++j) {
    for (int i = 0; i < 16; ++i) {
      const double dx = x + (i + 0.5) / 16 - 83.3;
      const double dy = y + (j + 0.5) / 16 - 57.8;
      inside += dx * dx + dy * dy < 25.4 * 25.4 ? 1 : 0;
    }
  }
  return inside / 256.0;
}

/// An image of the background with the ball mixed in by `with`, and noise of that deviation
/// [light].
Bitmap take(double with, double noise, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  Bitmap bitmap(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double alpha = with * coverage(x, y);
      const Vec3d body(0.25 + 0.001 * y, 0.05, 0.02);
      const Vec3d light = (1.0 - alpha) * background(x, y) + alpha * body;
      std::uint8_t* rgba = bitmap.rgba.data() + std::size_t(4) * std::size_t(y * kWidth + x);
      for (int c = 0; c < 3; ++c) rgba[c] = byte_of_linear(light[c] + noise * normal(random));
      rgba[3] = 255;
    }
  }
  return bitmap;
}

TEST(CleanPlate, TheNoiseOfAPlateIsFound) {
  for (const double noise : {0.004, 0.01, 0.02}) {
    const CleanPlate plate(take(0.0, noise, 1));
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(plate.noise(c, 0.2), noise, 0.15 * noise) << c;
      EXPECT_NEAR(plate.noise(c, 0.3), noise, 0.2 * noise) << c;
    }
  }
}

TEST(CleanPlate, AMatteIsTheCoverage) {
  for (const double noise : {0.0, 0.004, 0.01}) {
    const auto matte = CleanPlate(take(0.0, noise, 1)).matte(take(1.0, noise, 2)).alpha;
    double area = 0.0;
    double truth = 0.0;
    double edge_error = 0.0;
    double edge_bias = 0.0;
    int edges = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double alpha = matte[std::size_t(y) * kWidth + std::size_t(x)] / 255.0;
        const double expected = coverage(x, y);
        area += alpha;
        truth += expected;
        if (expected == 0.0) {
          ASSERT_EQ(alpha, 0.0) << x << " " << y;
        }
        if (expected <= 0.0 || expected >= 1.0) continue;
        edge_error += std::abs(alpha - expected);
        edge_bias += alpha - expected;
        ++edges;
      }
    }
    EXPECT_NEAR(area / truth, 1.0, 0.008) << noise;  // a tenth of a pixel all around
    EXPECT_LT(edge_error / edges, 0.1) << noise;
    EXPECT_LT(std::abs(edge_bias / edges), 0.05) << noise;
  }
}

TEST(CleanPlate, NoiseAloneIsNoBody) {
  for (unsigned seed = 2; seed < 8; ++seed) {
    const auto matte = CleanPlate(take(0.0, 0.01, 1)).matte(take(0.0, 0.01, seed)).alpha;
    EXPECT_LE(std::count_if(matte.begin(), matte.end(), [](int v) { return v > 0; }), 1);
  }
}

/// As where a lamp flickers beside the body: the smaller region goes.
TEST(CleanPlate, OnlyTheLargestRegionIsTheBody) {
  Bitmap image = take(1.0, 0.0, 2);
  for (int y = 4; y < 10; ++y) {
    for (int x = 4; x < 10; ++x) image.rgba[4 * (std::size_t(y) * kWidth + std::size_t(x))] = 255;
  }
  const auto matte = CleanPlate(take(0.0, 0.0, 1)).matte(image).alpha;
  EXPECT_EQ(matte[6 * kWidth + 6], 0);
  EXPECT_EQ(matte[58 * kWidth + 83], 255);
}

TEST(CleanPlate, AStripThinnerThanItsEdgeIsWhole) {
  Bitmap image = take(0.0, 0.0, 1);
  for (int x = 30; x < 130; ++x)
    image.rgba[4 * (std::size_t{60} * kWidth + std::size_t(x)) + 1] = 255;
  const auto matte = CleanPlate(take(0.0, 0.0, 1)).matte(image).alpha;
  for (int x = 30; x < 130; ++x) EXPECT_EQ(matte[std::size_t{60} * kWidth + std::size_t(x)], 255);
  EXPECT_EQ(matte[59 * kWidth + 80], 0);
}

TEST(CleanPlate, AnotherSizeIsRefused) {
  EXPECT_THROW((void)CleanPlate(take(0.0, 0.0, 1)).matte(Bitmap(8, 6)), Error);
  EXPECT_THROW(CleanPlate(Bitmap(2, 6)), Error);
}

}  // namespace
}  // namespace matterfit::capture
