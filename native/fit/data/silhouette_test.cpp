// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/silhouette.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

/// A disc in an image of 64 × 48 pixels, its edge soft over one.
std::vector<std::uint8_t> disc(double x, double y, double radius) {
  std::vector<std::uint8_t> matte(64 * 48);
  for (int j = 0; j < 48; ++j) {
    for (int i = 0; i < 64; ++i) {
      const double inside = radius - std::hypot(i + 0.5 - x, j + 0.5 - y) + 0.5;
      matte[std::size_t(64 * j + i)] =
          static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(inside, 0.0, 1.0)));
    }
  }
  return matte;
}

std::vector<float> mask_of(const std::vector<std::uint8_t>& matte) {
  std::vector<float> mask;
  for (const std::uint8_t value : matte) mask.push_back(float(value) / 255.0F);
  return mask;
}

TEST(Silhouette, ReducingKeepsTheArea) {
  const auto matte = disc(30, 22, 12);
  const Coverage image = reduced(matte, 64, 48, 4);
  EXPECT_EQ(image.width, 16);
  EXPECT_EQ(image.height, 12);
  const double area = std::accumulate(image.values.begin(), image.values.end(), 0.0);
  EXPECT_NEAR(16.0 * area, std::accumulate(matte.begin(), matte.end(), 0.0) / 255.0, 1e-3);
  splat::Camera camera;
  camera.width = 64;
  camera.height = 50;
  camera.fx = 80;
  camera.cx = 31;
  const splat::Camera small = reduced(camera, 4);
  EXPECT_EQ(small.height, 12);
  EXPECT_DOUBLE_EQ(small.fx, 20);
  EXPECT_DOUBLE_EQ(small.cx, 7.75);
}

TEST(Silhouette, ABlurKeepsWhatIsFarFromTheBorder) {
  Coverage image = reduced(disc(32, 24, 8), 64, 48, 1);
  const double before = std::accumulate(image.values.begin(), image.values.end(), 0.0);
  blur(image, 2.0);
  EXPECT_NEAR(std::accumulate(image.values.begin(), image.values.end(), 0.0), before, 1e-2);
  EXPECT_LT(image.values[std::size_t(64 * 24 + 32)], 1.0F);
}

/// What the weights promise: an outline that is displaced everywhere by one standard deviation
/// makes one unit of squares a pixel of its length, whatever the blur.
TEST(Silhouette, SquaresAreThoseOfADisplacedOutline) {
  for (const double deviation : {1.5, 3.0}) {
    for (const double noise : {0.25, 0.5}) {
      Coverage a = reduced(disc(32, 24, 14), 64, 48, 1);
      Coverage b = reduced(disc(32, 24, 14 + noise), 64, 48, 1);
      blur(a, deviation);
      blur(b, deviation);
      const double sigma = coverage_deviation(noise, std::hypot(deviation, 0.3));
      double squares = 0.0;
      for (std::size_t i = 0; i < a.values.size(); ++i) {
        squares += std::pow((a.values[i] - b.values[i]) / sigma, 2);
      }
      EXPECT_NEAR(squares / (2.0 * M_PI * 14.0), 1.0, 0.08) << deviation << " " << noise;
      EXPECT_NEAR(outline_length(a), 2.0 * M_PI * 14.0, 3.0);
    }
  }
}

TEST(Silhouette, AgreementIsOverlapAndDistance) {
  const auto matte = disc(30, 24, 12);
  const Silhouette seen(matte, 64, 48);
  const Agreement same = agreement(mask_of(matte), seen);
  EXPECT_EQ(same.iou, 1.0);
  EXPECT_NEAR(same.contour_px, 0.0, 1e-6);
  const Agreement larger = agreement(mask_of(disc(30, 24, 14)), seen);
  EXPECT_NEAR(larger.contour_px, 2.0, 0.1);
  EXPECT_NEAR(larger.iou, 144.0 / 196.0, 0.02);
  EXPECT_EQ(larger.missing, 0U);
  EXPECT_GT(larger.outside, 100U);
  const std::vector<float> none(64 * 48, 0.0F);
  const Agreement empty = agreement(none, seen);
  EXPECT_EQ(empty.iou, 0.0);
  EXPECT_TRUE(std::isnan(empty.contour_px));
  const Silhouette nothing(std::vector<std::uint8_t>(64 * 48, 0), 64, 48);
  EXPECT_TRUE(std::isnan(agreement(none, nothing).iou)) << "an image of nothing agrees in nothing";
  EXPECT_THROW((void)agreement(std::vector<float>(64 * 47, 0.0F), seen), Error);
  EXPECT_THROW(Silhouette(matte, 64, 47), Error);
}

/// Covered up to its last pixel, and from its first.
TEST(Silhouette, KeepsWhatIsCovered) {
  for (const int shift : {0, 24, 48}) {
    const auto matte = disc(shift + 8.0, shift, 20);
    const std::vector<std::uint8_t> covered = Silhouette(matte, 64, 48).covered();
    ASSERT_EQ(covered.size(), matte.size());
    for (std::size_t i = 0; i < matte.size(); ++i) {
      ASSERT_EQ(covered[i], matte[i] >= 128 ? 1 : 0) << i;
    }
  }
}

}  // namespace
}  // namespace matterfit::fit
