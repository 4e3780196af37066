// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/colour_agreement.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace matterfit::fit {
namespace {

constexpr int kEdge = 48;

/// The pixel at (x, y).
std::size_t pixel(int x, int y) { return std::size_t(y) * std::size_t(kEdge) + std::size_t(x); }

std::array<Coverage, 3> picture(const std::function<double(int, int, int)>& value) {
  std::array<Coverage, 3> result;
  for (int c = 0; c < 3; ++c) {
    Coverage& channel = result[std::size_t(c)];
    channel = {kEdge, kEdge, std::vector<float>(pixel(0, kEdge))};
    for (int y = 0; y < kEdge; ++y) {
      for (int x = 0; x < kEdge; ++x) {
        channel.values[pixel(x, y)] = float(value(c, x, y));
      }
    }
  }
  return result;
}

double waves(int c, int x, int y) { return 0.5 + 0.3 * std::sin(0.7 * x + c) * std::cos(0.5 * y); }

Coverage disc() {
  return picture([](int, int x, int y) {
    return std::hypot(x - kEdge / 2, y - kEdge / 2) < 15.0 ? 1.0 : 0.0;
  })[0];
}

TEST(ColourAgreement, OfAnImageWithItselfIsWhole) {
  const ColourAgreement same = colour_agreement(picture(waves), picture(waves), disc());
  EXPECT_NEAR(same.ssim, 1.0, 1e-5);
  EXPECT_GT(same.psnr_db, 100.0);
}

TEST(ColourAgreement, OfFlatImagesIsTheirLuminance) {
  const auto flat = [](double value) { return picture([value](int, int, int) { return value; }); };
  const ColourAgreement apart = colour_agreement(flat(0.5), flat(0.6), disc());
  EXPECT_NEAR(apart.psnr_db, 20.0, 1e-4);
  EXPECT_NEAR(apart.ssim, (2.0 * 0.3 + 1e-4) / (0.25 + 0.36 + 1e-4), 1e-3);
}

TEST(ColourAgreement, ABrighterImageIsMoreAlikeThanAnotherPattern) {
  const auto brighter = picture([](int c, int x, int y) { return waves(c, x, y) + 0.1; });
  const auto other = picture([](int c, int x, int y) { return 1.0 - waves(c, x, y); });
  EXPECT_GT(colour_agreement(picture(waves), brighter, disc()).ssim, 0.9);
  EXPECT_LT(colour_agreement(picture(waves), other, disc()).ssim, 0.0);
}

/// What is around the body has no part in it.
TEST(ColourAgreement, LooksAtNothingElse) {
  const Coverage compared = disc();
  const auto framed = picture([&](int c, int x, int y) {
    return compared.values[pixel(x, y)] > 0.0F ? waves(c, x, y) : 1.0;
  });
  const ColourAgreement same = colour_agreement(picture(waves), framed, compared);
  EXPECT_NEAR(same.ssim, 1.0, 1e-5);
  EXPECT_GT(same.psnr_db, 100.0);
}

TEST(ColourAgreement, OfNothingIsUnknown) {
  Coverage none = disc();
  for (float& value : none.values) value = 0.0F;
  const ColourAgreement unknown = colour_agreement(picture(waves), picture(waves), none);
  EXPECT_TRUE(std::isnan(unknown.ssim));
  EXPECT_TRUE(std::isnan(unknown.psnr_db));
}

}  // namespace
}  // namespace matterfit::fit
