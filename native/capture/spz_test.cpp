// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/spz.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "capture/spz_for_test.hpp"

namespace matterfit::capture {
namespace {

using ::testing::HasSubstr;
using namespace spz_test;

void append(Bytes& bytes, const Bytes& more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

/// Two Gaussians, attribute by attribute.
Bytes two(std::uint8_t version, std::uint8_t degree) {
  Bytes bytes = spz_header(version, 2, degree, 1);
  // 1, −2, 0.5 m with twelve bits after the point; then zeros.
  append(bytes, {0x00, 0x10, 0x00, 0x00, 0xe0, 0xff, 0x00, 0x08, 0x00});
  append(bytes, Bytes(9, 0));
  append(bytes, {51, 255});                // opacities
  append(bytes, {255, 0, 51, 0, 0, 0});    // colours
  append(bytes, {160, 144, 96, 0, 0, 0});  // scales
  if (version == 2) {
    append(bytes, {255, 0, 0, 0, 0, 0});  // beyond the unit sphere: w = 0
  } else {
    // y largest; then x, z, w in 10 bits each, w in the lowest: x = −√½, z = w = 0.
    const std::uint32_t packed = (1U << 30U) | ((512U + 511U) << 20U);
    for (unsigned k = 0; k < 4; ++k) bytes.push_back(static_cast<std::uint8_t>(packed >> 8U * k));
    append(bytes, {0, 0, 0, 0xc0});  // w largest: identity
  }
  const std::size_t rest = 3 * (static_cast<std::size_t>((degree + 1) * (degree + 1)) - 1);
  for (std::size_t k = 0; k < 2 * rest; ++k) bytes.push_back(static_cast<std::uint8_t>(128 + k));
  return bytes;
}

std::string refusal_of_spz(const std::vector<std::byte>& bytes) {
  try {
    (void)parse_spz(bytes, "scene.spz");
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

TEST(Spz, BothVersionsAreReadAsTheFormatSays) {
  for (const std::uint8_t version : {std::uint8_t{2}, std::uint8_t{3}}) {
    SCOPED_TRACE(int{version});
    const Splats splats = parse_spz(gzip(two(version, 1)), "scene.spz");
    ASSERT_EQ(splats.size(), 2U);
    EXPECT_EQ(splats.sh_degree, 1);
    EXPECT_TRUE(splats.antialiased);
    EXPECT_EQ(splats.means[0], Vec3f(1.0F, -2.0F, 0.5F));
    EXPECT_EQ(splats.means[1], Vec3f::Zero());
    EXPECT_FLOAT_EQ(splats.opacities[0], 0.2F);
    EXPECT_FLOAT_EQ(splats.scales[0].x(), 1.0F);
    EXPECT_FLOAT_EQ(splats.scales[0].y(), std::exp(-1.0F));
    EXPECT_FLOAT_EQ(splats.scales[1].z(), std::exp(-10.0F));
    EXPECT_FLOAT_EQ(splats.sh[0], 0.5F / 0.15F);
    EXPECT_FLOAT_EQ(splats.sh[1], -0.5F / 0.15F);
    // Coefficient-major: red, green, blue of the first band.
    EXPECT_FLOAT_EQ(splats.sh[3], 0.0F);
    EXPECT_FLOAT_EQ(splats.sh[4], 1.0F / 128.0F);
    EXPECT_FLOAT_EQ(splats.sh[12 + 3], 9.0F / 128.0F);
    const Eigen::Quaternionf& q = splats.rotations[0];
    EXPECT_NEAR(q.norm(), 1.0F, 1e-6F);
    if (version == 2) {
      EXPECT_NEAR(q.w(), 0.0F, 1e-6F);
      EXPECT_GT(q.x(), 0.0F);
      EXPECT_FLOAT_EQ(q.y(), -q.x());
    } else {
      EXPECT_FLOAT_EQ(q.x(), -std::sqrt(0.5F));
      EXPECT_FLOAT_EQ(q.y(), std::sqrt(0.5F));
      EXPECT_EQ(splats.rotations[1].w(), 1.0F);
    }
  }
}

TEST(Spz, WhatIsNoneIsRefusedInWords) {
  EXPECT_THAT(refusal_of_spz({}), HasSubstr("cannot be unpacked"));
  EXPECT_THAT(refusal_of_spz(std::vector<std::byte>(40, std::byte{7})),
              HasSubstr("the header cannot be unpacked"));
  EXPECT_THAT(refusal_of_spz(gzip(Bytes(16, 0))), HasSubstr("does not begin as an SPZ file"));
  EXPECT_THAT(refusal_of_spz(gzip(spz_header(1, 1, 0, 0))), HasSubstr("SPZ version 1"));
  EXPECT_THAT(refusal_of_spz(gzip(spz_header(3, 0, 0, 0))), HasSubstr("holds no Gaussians"));
  EXPECT_THAT(refusal_of_spz(gzip(spz_header(3, 1, 4, 0))), HasSubstr("degree 4"));
  Bytes fraction = spz_header(3, 1, 0, 0);
  fraction[13] = 24;
  EXPECT_THAT(refusal_of_spz(gzip(fraction)), HasSubstr("24 bits after the point"));
  Bytes many = spz_header(3, 1, 0, 0);
  many[11] = 0x7f;
  EXPECT_THAT(refusal_of_spz(gzip(many)), HasSubstr("more than its"));
  Bytes cut = two(3, 1);
  cut.resize(cut.size() - 5);
  EXPECT_THAT(refusal_of_spz(gzip(cut)), HasSubstr("the harmonics cannot be unpacked"));
}

}  // namespace
}  // namespace matterfit::capture
