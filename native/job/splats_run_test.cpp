// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "capture/npz.hpp"
#include "capture/splats.hpp"
#include "job/clip_for_test.hpp"
#include "job/run/inspect.hpp"
#include "job/run/splat_points.hpp"

/// Files of splats that are thrown, drawn and shown.
namespace matterfit::job {
namespace {

using namespace fit_test;
using ::testing::HasSubstr;

constexpr std::size_t kOnTheBall = 400;

/// A red ball of .2 m about (0, 0, .5), and a floater of little opacity a metre beside it.
capture::Splats red_ball() {
  capture::Splats splats;
  for (std::size_t i = 0; i <= kOnTheBall; ++i) {
    const double z = 1.0 - 2.0 * (double(i) + 0.5) / double(kOnTheBall);
    const double angle = 2.4 * double(i);
    const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
    const Vec3d on(0.2 * r * std::cos(angle), 0.2 * r * std::sin(angle), 0.5 + 0.2 * z);
    const bool floats = i == kOnTheBall;
    splats.means.emplace_back(floats ? Vec3f(1.0F, 0.0F, 0.5F) : Vec3f(on.cast<float>()));
    splats.rotations.push_back(Eigen::Quaternionf::Identity());
    splats.scales.emplace_back(Vec3f::Constant(floats ? 0.1F : 0.015F));
    splats.opacities.push_back(floats ? 0.05F : 0.9F);
    for (const float colour : {1.0F, 0.0F, 0.0F})
      splats.sh.push_back((colour - 0.5F) / 0.28209479F);
  }
  return splats;
}

Json thrown_ball() {
  return Json::parse(R"({ "schema": "matterfit.job/1", "task": "render",
    "scene": { "fps": 24, "frames": [0, 3], "particle_separation": 0.04,
      "bodies": [ { "name": "ball", "density": 1000, "velocity": [1.2, 0, 0],
        "source": { "gaussians": "ball.splat" },
        "material": { "law": "neo_hookean", "E": 1e5, "nu": 0.3 } } ] },
    "render": { "cameras": "clip/transforms.json" },
    "output": { "splats": [ { "name": "ball", "gaussians": "ball.splat" } ] } })");
}

class SplatsRunTest : public ::testing::Test {
 protected:
  void SetUp() override {
    capture::write_splats(folder_.path / "ball.splat", red_ball());
    capture::CameraSet set;
    set.cameras = {looking(Vec3d(0.3, -2.5, 0.6), Vec3d(0.3, 0.0, 0.5))};
    capture::Shot shot;
    shot.image = "c0.png";
    set.shots = {shot};
    write_file(folder_.path / "clip/transforms.json", capture::format_cameras(set));
  }
  /// Its opaque pixels' mean column, and how many there are.
  [[nodiscard]] std::pair<double, int> seen(const std::string& file) const {
    const capture::Bitmap picture = capture::read_png(folder_.path / file);
    double sum = 0.0;
    int count = 0;
    for (std::size_t i = 0; i < picture.pixels(); ++i) {
      if (picture.rgba[4 * i + 3] < 8) continue;
      sum += double(i % std::size_t(picture.width));
      ++count;
    }
    return {count > 0 ? sum / count : -1.0, count};
  }

  const Folder folder_;
};

TEST_F(SplatsRunTest, WhatIsFaintIsNotThrown) {
  Json document = thrown_ball();
  Json& splats = document["output"]["splats"][0];
  splats["opacity_threshold"] = 0.1;
  splats["format"] = "splat";
  const Json result = run(document, folder_.path);
  EXPECT_EQ(result.at("render").at("pictures"), 3);
  for (const char* frame : {"0000", "0001", "0002"}) {
    const capture::Splats one =
        capture::read_splats(folder_.path / ("out/splat/ball_" + std::string(frame) + ".splat"));
    EXPECT_EQ(one.size(), kOnTheBall) << frame;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_.path / "out/splat/ball_0000.ply"));
  const auto [first, many] = seen("out/render/camera_0/0000.png");
  const auto [last, as_many] = seen("out/render/camera_0/0002.png");
  EXPECT_GT(many, 100);
  EXPECT_NEAR(as_many, many, 0.1 * many);
  EXPECT_GT(last, first + 3.0) << "it moves to the right by .1 m, about six pixels";

  splats.erase("format");
  splats["opacity_threshold"] = 0.95;
  document["output"]["folder"] = "none";
  try {
    (void)run(document, folder_.path);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_THAT(error.what(), HasSubstr("output.splats[0]: no splat has an opacity of 0.95"));
  }
}

TEST_F(SplatsRunTest, AStillIsCroppedAndItsFloatersLeftOut) {
  const auto drawn = [&](const char* name, const Json& with) {
    Json document = {{"schema", "matterfit.job/1"}, {"task", "render"}};
    document["render"] = {{"cameras", "clip/transforms.json"}, {"gaussians", "ball.splat"}};
    document["render"].update(with);
    document["output"]["folder"] = name;
    (void)run(document, folder_.path);
    return seen(std::string(name) + "/render/camera_0.png").second;
  };
  const int all = drawn("all", Json::object());
  const int opaque = drawn("opaque", {{"opacity_threshold", 0.1}});
  EXPECT_LT(opaque, all - 50);
  const Json half = {{"low", {-1, -1, 0.5}}, {"high", {0.5, 1, 1}}};
  const int upper = drawn("upper", {{"crop", half}});
  EXPECT_NEAR(upper, 0.5 * opaque, 0.2 * opaque);
  try {
    (void)drawn("nothing", {{"opacity_threshold", 0.99}});
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("render.gaussians: no splat has an opacity of 0.99"));
    EXPECT_THAT(error.what(), HasSubstr("the most opaque one has 0.9"));
  }
}

TEST_F(SplatsRunTest, PointsOfAFileAreThinned) {
  const auto file = folder_.path / "ball.splat";
  const auto npz = folder_.path / "points.npz";
  Json said = write_splat_points(file, {{"opacity_threshold", 0.1}, {"most", 100}}, npz);
  EXPECT_EQ(said.at("gaussians"), kOnTheBall + 1);
  EXPECT_EQ(said.at("kept"), kOnTheBall);
  EXPECT_EQ(said.at("written"), 100);
  EXPECT_NEAR(said.at("high")[2].get<double>(), 0.7, 0.01);
  capture::Arrays arrays = capture::read_npz(npz);
  EXPECT_EQ(arrays.at("positions").shape_text(), "(100, 3)");
  EXPECT_EQ(arrays.at("rotations").shape_text(), "(100, 4)");
  const std::vector<float> colours = arrays.at("colours").floats("colours");
  EXPECT_NEAR(colours[0], 1.0F, 1e-5F);
  EXPECT_NEAR(colours[1], 0.0F, 1e-5F);
  EXPECT_NEAR(arrays.at("scales").floats("scales")[0], 0.015F, 1e-6F);
  said = write_splat_points(file, Json::object(), npz);
  EXPECT_EQ(said.at("written"), kOnTheBall + 1);
  EXPECT_THROW((void)write_splat_points(file, {{"mst", 3}}, npz), Error);
}

TEST(SplatsRun, AFileIsInspected) {
  const Folder folder;
  for (const char* name : {"ball.ply", "ball.splat"}) {
    capture::write_splats(folder.path / name, red_ball());
    const Json found = file_summary(folder.path / name);
    EXPECT_EQ(found.at("gaussians"), kOnTheBall + 1) << name;
    EXPECT_NEAR(found.at("high")[0].get<double>(), 1.0, 1e-6) << name;
    EXPECT_NEAR(found.at("median_opacity").get<double>(), 0.9, 0.01) << name;
    EXPECT_THAT(found.at("text").dump(), HasSubstr("401 splats")) << name;
  }
  write_file(folder.path / "broken.splat", "too short");
  EXPECT_THROW((void)file_summary(folder.path / "broken.splat"), Error);
}

}  // namespace
}  // namespace matterfit::job
