// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/dot_splat.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// One Gaussian as the format has it.
std::vector<std::byte> row(const std::array<float, 6>& floats,
                           const std::array<std::uint8_t, 8>& bytes) {
  std::vector<std::byte> out(32);
  std::memcpy(out.data(), floats.data(), 24);
  std::memcpy(out.data() + 24, bytes.data(), 8);
  return out;
}

std::string refusal_of_splat(const std::vector<std::byte>& bytes) {
  try {
    (void)parse_dot_splat(bytes, "scene.splat");
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

TEST(DotSplat, IsReadAsTheFormatSays) {
  const Splats splats = parse_dot_splat(
      row({1, 2, 3, 0.1F, 0.2F, 0.0F}, {255, 0, 51, 102, 192, 128, 64, 128}), "scene.splat");
  ASSERT_EQ(splats.size(), 1U);
  EXPECT_EQ(splats.sh_degree, 0);
  EXPECT_EQ(splats.means[0], Vec3f(1, 2, 3));
  EXPECT_EQ(splats.scales[0], Vec3f(0.1F, 0.2F, 1e-9F));
  EXPECT_FLOAT_EQ(0.5F + 0.28209479F * splats.sh[0], 1.0F);
  EXPECT_NEAR(0.5F + 0.28209479F * splats.sh[1], 0.0F, 1e-7F);
  EXPECT_FLOAT_EQ(0.5F + 0.28209479F * splats.sh[2], 0.2F);
  EXPECT_FLOAT_EQ(splats.opacities[0], 0.4F);
  EXPECT_FLOAT_EQ(splats.rotations[0].w(), std::sqrt(0.5F));
  EXPECT_FLOAT_EQ(splats.rotations[0].y(), -std::sqrt(0.5F));
}

TEST(DotSplat, WhatIsNoneIsRefusedInWords) {
  const std::array<std::uint8_t, 8> bytes = {0, 0, 0, 255, 255, 128, 128, 128};
  auto cut = row({0, 0, 0, 1, 1, 1}, bytes);
  cut.pop_back();
  EXPECT_THAT(refusal_of_splat(cut), HasSubstr("has 31 bytes, expected 32 a Gaussian"));
  EXPECT_THAT(refusal_of_splat({}), HasSubstr("has 0 bytes"));
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(refusal_of_splat(row({0, kNan, 0, 1, 1, 1}, bytes)),
              HasSubstr("row 0: the position"));
  EXPECT_THAT(refusal_of_splat(row({0, 0, 0, 1, -1, 1}, bytes)), HasSubstr("a scale is -1"));
  EXPECT_THAT(refusal_of_splat(row({0, 0, 0, 1, 1, 1}, {0, 0, 0, 0, 128, 128, 128, 128})),
              HasSubstr("rotation is zero"));
}

TEST(DotSplat, ARealScanIsReadWrittenAndReadAgain) {
  const fs::path scan = fs::path(MATTERFIT_DATA_DIR) / "splats/academic_tarot_cards.splat";
  if (!fs::exists(scan)) GTEST_SKIP() << scan << " is missing";
  const Splats splats = read_splats(scan);
  ASSERT_EQ(splats.size(), 114865U);
  Vec3f low = splats.means[0];
  Vec3f high = low;
  double anisotropy_above_two = 0;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    low = low.cwiseMin(splats.means[i]);
    high = high.cwiseMax(splats.means[i]);
    if (splats.scales[i].maxCoeff() > 2.0F * splats.scales[i].minCoeff()) ++anisotropy_above_two;
  }
  EXPECT_FLOAT_EQ(low.y(), -0.5F);
  EXPECT_FLOAT_EQ(high.y(), 0.5F);
  EXPECT_GT(anisotropy_above_two, 0.5 * 114865);
  const fs::path copy =
      fs::temp_directory_path() / ("matterfit_scan_" + std::to_string(::getpid()) + ".splat");
  write_splats(copy, splats);
  const auto first = read_file(scan);
  const auto second = read_file(copy);
  fs::remove(copy);
  ASSERT_EQ(first.size(), second.size());
  // Quaternions are normalised on reading; all else is the same, byte for byte.
  std::size_t different = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    if (i % 32 < 28 && first[i] != second[i]) ++different;
  }
  EXPECT_EQ(different, 0U);
}

}  // namespace
}  // namespace matterfit::capture
