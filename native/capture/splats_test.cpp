// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/splats.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <map>
#include <string_view>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/message_for_test.hpp"
#include "capture/ply.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class SplatsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = fs::temp_directory_path() / ("matterfit_splats_" + std::to_string(::getpid()) + ".ply");
  }
  void TearDown() override { fs::remove(path_); }

  /// One row as a trainer writes it, with f_rest_k = 100 + k.
  static std::map<std::string, float> row(int rest) {
    std::map<std::string, float> values = {
        {"x", 1.0F},        {"y", 2.0F},        {"z", 3.0F},        {"nx", 0.0F},
        {"f_dc_0", 0.1F},   {"f_dc_1", 0.2F},   {"f_dc_2", 0.3F},   {"opacity", 0.0F},
        {"scale_0", -3.0F}, {"scale_1", -4.0F}, {"scale_2", -5.0F}, {"rot_0", 2.0F},
        {"rot_1", 0.0F},    {"rot_2", 0.0F},    {"rot_3", 2.0F}};
    for (int k = 0; k < rest; ++k) {
      values["f_rest_" + std::to_string(k)] = static_cast<float>(100 + k);
    }
    return values;
  }
  Splats read(const std::map<std::string, float>& row) const {
    std::vector<PlyColumn> columns;
    columns.reserve(row.size());
    for (const auto& [name, value] : row) columns.push_back({name, std::span(&value, 1)});
    write_ply_points(path_, columns);
    return read_splats(path_);
  }
  fs::path path_;
};

TEST_F(SplatsTest, ActivationsAndChannelMajorHarmonics) {
  int degree = 0;
  for (const int rest : {0, 9, 24, 45}) {
    const Splats splats = read(row(rest));
    SCOPED_TRACE(rest);
    ASSERT_EQ(splats.size(), 1U);
    EXPECT_EQ(splats.sh_degree, degree++);
    EXPECT_EQ(splats.means[0], Vec3f(1, 2, 3));
    EXPECT_FLOAT_EQ(splats.scales[0].y(), std::exp(-4.0F));
    EXPECT_FLOAT_EQ(splats.opacities[0], 0.5F);
    EXPECT_FLOAT_EQ(splats.rotations[0].w(), std::sqrt(0.5F));
    EXPECT_FLOAT_EQ(splats.rotations[0].z(), std::sqrt(0.5F));
    const std::size_t bands = splats.sh_bands();
    ASSERT_EQ(splats.sh.size(), bands * 3);
    EXPECT_EQ(splats.sh[1], 0.2F);
    if (rest > 0) {
      // The green part of the first band lies after all of red in the file.
      EXPECT_EQ(splats.sh[3 + 1], 100.0F + static_cast<float>(bands - 1));
      EXPECT_EQ(splats.sh[(bands - 1) * 3 + 2], static_cast<float>(99 + rest));
    }
  }
}

TEST_F(SplatsTest, IsotropicFilesHaveOneScale) {
  auto values = row(0);
  for (const char* key : {"scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    values.erase(key);
  }
  const Splats splats = read(values);
  EXPECT_TRUE(splats.isotropic);
  EXPECT_EQ(splats.scales[0], Vec3f::Constant(std::exp(-3.0F)));
  EXPECT_EQ(splats.rotations[0].coeffs(), Eigen::Quaternionf::Identity().coeffs());
}

TEST_F(SplatsTest, RoundTrip) {
  for (const int rest : {0, 45}) {
    const Splats first = read(row(rest));
    write_splats(path_, first);
    const Splats second = read_splats(path_);
    EXPECT_EQ(second.sh_degree, first.sh_degree);
    EXPECT_EQ(second.sh, first.sh);
    EXPECT_EQ(second.means, first.means);
    EXPECT_LT((second.scales[0] - first.scales[0]).norm(), 1e-7F);
    EXPECT_LT(second.rotations[0].angularDistance(first.rotations[0]), 1e-3F);
    EXPECT_NEAR(second.opacities[0], first.opacities[0], 1e-6F);
  }
}

TEST_F(SplatsTest, WhatIsNoSplatFileIsRefusedInWords) {
  const auto refuse = [&](const std::map<std::string, float>& values, const char* words) {
    EXPECT_THAT(message_of([&] { (void)read(values); }), HasSubstr(words));
  };
  auto values = row(9);
  values.erase("f_rest_3");
  refuse(values, "has 8 properties f_rest_*");
  values = row(0);
  values.erase("opacity");
  refuse(values, "no property 'opacity'");
  values = row(0);
  values["scale_1"] = 1000.0F;
  refuse(values, "row 0: a scale overflows");
  values = row(0);
  values["rot_0"] = values["rot_3"] = 0.0F;
  refuse(values, "the rotation is zero");
  values = row(0);
  values["x"] = NAN;
  refuse(values, "'x' is not finite");
}

TEST_F(SplatsTest, TheNameSaysTheFormat) {
  const fs::path folder = fs::temp_directory_path();
  const auto words = [&](const char* name) {
    return message_of([&] { (void)read_splats(folder / name); });
  };
  EXPECT_THAT(words("scene.ksplat"), HasSubstr("splat-transform scene.ksplat scene.ply"));
  EXPECT_THAT(words("scene.SOG"), HasSubstr(".sog files are not read"));
  EXPECT_THAT(words("meta.json"), HasSubstr("splat-transform meta.json meta.ply"));
  const fs::path packed = fs::path(path_).replace_extension(".ply");
  const std::string_view header =
      "ply\nformat binary_little_endian 1.0\nelement chunk 1\nproperty float min_x\n"
      "element vertex 1\nproperty uint packed_position\nend_header\n";
  write_file(packed, header);
  EXPECT_THAT(message_of([&] { (void)read_splats(packed); }), HasSubstr("packed Gaussians"));
  fs::remove(packed);
  const Splats first = read(row(9));
  const fs::path other = fs::path(path_).replace_extension(".SPLAT");
  write_splats(other, first);
  EXPECT_EQ(fs::file_size(other), 32U);
  const Splats second = read_splats(other);
  fs::remove(other);
  EXPECT_EQ(second.sh_degree, 0);
  EXPECT_EQ(second.means, first.means);
  EXPECT_EQ(second.scales, first.scales);
  EXPECT_NEAR(second.sh[1], first.sh[1], 0.5F / 255.0F / 0.28F);
  EXPECT_NEAR(second.opacities[0], first.opacities[0], 0.51F / 255.0F);
  EXPECT_LT(second.rotations[0].angularDistance(first.rotations[0]), 0.01F);
}

TEST_F(SplatsTest, TheRasterisersGaussiansAreTheSame) {
  const Splats splats = read(row(24));
  const splat::Gaussians g = gaussians_of(splats);
  ASSERT_EQ(g.size(), 1U);
  EXPECT_EQ(g.sh_degree, 2);
  EXPECT_EQ(g.means, splats.means);
  EXPECT_EQ(g.sh, splats.sh);
  EXPECT_NEAR(g.log_scales[0].z(), -5.0F, 1e-5F);
  EXPECT_FLOAT_EQ(g.rotations[0][0], std::sqrt(0.5F));
  EXPECT_FLOAT_EQ(g.rotations[0][3], std::sqrt(0.5F));
  EXPECT_EQ(g.opacities, splats.opacities);
}

TEST_F(SplatsTest, ACropKeepsWhatLiesInIt) {
  const Splats one = read(row(9));
  Splats splats = one;
  for (const float x : {-2.0F, 1.5F}) {
    splats.means.emplace_back(x, 2.0F, 3.0F);
    splats.rotations.push_back(one.rotations[0]);
    splats.scales.push_back(one.scales[0]);
    splats.opacities.push_back(0.25F);
    for (const float value : one.sh) splats.sh.push_back(x + value);
  }
  const Splats kept = cropped(splats, {Vec3d(0.9, 0.0, 0.0), Vec3d(2.0, 4.0, 4.0)});
  ASSERT_EQ(kept.size(), 2U);
  EXPECT_EQ(kept.sh_degree, 1);
  EXPECT_EQ(kept.means[1], Vec3f(1.5F, 2.0F, 3.0F));
  EXPECT_EQ(kept.opacities[1], 0.25F);
  ASSERT_EQ(kept.sh.size(), 2 * one.sh.size());
  EXPECT_EQ(kept.sh[one.sh.size()], 1.5F + one.sh[0]);
  const std::string message = message_of([&] {
    (void)cropped(splats, {Vec3d(5.0, 5.0, 5.0), Vec3d(6.0, 6.0, 6.0)});
  });
  EXPECT_THAT(message, HasSubstr("(5, 5, 5) to (6, 6, 6)"));
  EXPECT_THAT(message, HasSubstr("from (-2, 2, 3) to (1.5, 2, 3)"));
}

}  // namespace
}  // namespace matterfit::capture
