// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "capture/png.hpp"
#include "job/clip_for_test.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using ::testing::HasSubstr;
using ::testing::Not;

Json compared_with_clip() {
  Json document = thrown_cube();
  document["task"] = "compare";
  document["captures"] = Json::array({{{"cameras", "clip/transforms.json"}}});
  return document;
}

/// What a fit would have found and what is half a metre a second off it, of a take that neither has
/// seen.
TEST(CompareImages, ATakeIsPredictedAndJudged) {
  const Folder folder;
  film(filmed_cube(), folder.path, two_cameras());
  Json document = compared_with_clip();
  document["captures"][0]["holdout"] = {{"cameras", {1}}};
  document["output"]["overlays"] = true;
  const Json result = run(document, folder.path);
  const Json& right = result.at("compare").at("images")[0];
  EXPECT_EQ(right.at("name"), "clip");
  EXPECT_EQ(right.at("images"), 28);
  EXPECT_GT(right.at("iou").get<double>(), 0.93);
  EXPECT_LT(right.at("contour_px").get<double>(), 0.8);
  EXPECT_EQ(right.at("held_out").at("images"), 14);
  EXPECT_EQ(right.at("not_held_out").at("images"), 14);
  ASSERT_EQ(right.at("cameras").size(), 2U);
  EXPECT_EQ(right.at("cameras")[1].at("camera"), 1);
  EXPECT_EQ(right.at("cameras")[0].at("particle_size"), right.at("cameras")[1].at("particle_size"))
      << "one that is held out takes that of the others";
  ASSERT_EQ(right.at("frames").size(), 28U);
  const Json& last = right.at("frames").back();
  EXPECT_EQ(last.at("frame"), 13.0);
  EXPECT_EQ(last.at("camera"), 1);
  EXPECT_EQ(last.at("image"), "c1_13.png");
  EXPECT_TRUE(last.at("held_out").get<bool>());
  EXPECT_FALSE(last.contains("psnr_db"));

  const capture::Bitmap overlay =
      capture::read_png(folder.path / "out/overlay/clip/camera_1/0013.png");
  EXPECT_EQ(overlay.width, kClipWidth);
  std::size_t outside = 0;
  std::size_t missing = 0;
  const int corner = kClipHeight - 7;  // the number is written below
  for (int i = 0; i < kClipWidth * corner; ++i) {
    const std::uint8_t* rgba = overlay.rgba.data() + 4 * std::size_t(i);
    outside += rgba[3] > 100 && rgba[0] == 255 && rgba[2] == 0 ? 1 : 0;
    missing += rgba[3] > 100 && rgba[0] == 0 && rgba[2] == 255 ? 1 : 0;
  }
  EXPECT_EQ(outside, last.at("outside_px"));
  EXPECT_EQ(missing, last.at("missing_px"));

  document["scene"]["bodies"][0]["velocity"] = {1.2, 0.6, -1.5};
  document["output"]["folder"] = "wrong";
  const Json other = run(document, folder.path).at("compare").at("images")[0];
  EXPECT_LT(other.at("iou").get<double>(), right.at("iou").get<double>() - 0.1);
  EXPECT_GT(other.at("contour_px").get<double>(), 3.0 * right.at("contour_px").get<double>());
  EXPECT_GT(other.at("worst").at("frame").get<double>(), 5.0);
}

/// The colours of the first image, on the way and on the floor.
TEST(CompareImages, ColoursOfALaterImageAreMeasured) {
  const Folder folder;
  const auto checks = [](const auto& scene, const auto& state, const auto& camera) {
    return paint(scene, state, camera, [](const Vec3d& rest) {
      const bool dark = int(std::floor(rest.x() / 0.2) + std::floor(rest.z() / 0.2)) % 2 != 0;
      return dark ? Vec3d(0.3, 0.1, 0.1) : Vec3d(0.7, 0.8, 0.3);
    });
  };
  film(filmed_cube(), folder.path, two_cameras(), checks);
  Json document = compared_with_clip();
  document["captures"][0]["colours"] = true;
  const Json right = run(document, folder.path).at("compare").at("images")[0];
  EXPECT_GT(right.at("psnr_db").get<double>(), 18.0) << right.dump(1);
  EXPECT_GT(right.at("ssim").get<double>(), 0.6);
  document["scene"]["bodies"][0]["spin"] = {0.0, 0.0, 4.0};
  document["output"]["folder"] = "wrong";
  const Json other = run(document, folder.path).at("compare").at("images")[0];
  EXPECT_LT(other.at("psnr_db").get<double>(), right.at("psnr_db").get<double>() - 3.0);
  EXPECT_LT(other.at("ssim").get<double>(), right.at("ssim").get<double>() - 0.2);
}

/// A camera that no fit sees is judged by images of their own size, apart from the others.
TEST(CompareImages, ColoursOfAHeldOutCameraStandApart) {
  const Folder folder;
  const auto halves = [](const auto& scene, const auto& state, const auto& camera) {
    return paint(scene, state, camera, [](const Vec3d& rest) {
      return rest.z() > 0.5 ? Vec3d(0.7, 0.8, 0.3) : Vec3d(0.3, 0.1, 0.1);
    });
  };
  std::vector<splat::Camera> cameras = two_cameras();
  cameras.push_back(looking(Vec3d(0.4, -2.1, 1.0), kFlightMiddle));          // beside the first
  cameras.push_back(looking(Vec3d(0.6, -2.0, 0.9), Vec3d(0.6, -4.0, 0.9)));  // looks away
  film(filmed_cube(), folder.path, cameras, halves);
  Json document = compared_with_clip();
  document["captures"][0]["colours"] = true;
  document["captures"][0]["holdout"] = {{"cameras", {2, 3}}};
  const Json result = run(document, folder.path).at("compare");
  const Json& images = result.at("images")[0];
  EXPECT_FALSE(images.contains("psnr_db")) << "of images of two sizes";
  for (const char* which : {"held_out", "not_held_out"}) {
    EXPECT_GT(images.at(which).at("psnr_db").get<double>(), 16.0) << which << images.dump(1);
    EXPECT_GT(images.at(which).at("ssim").get<double>(), 0.5) << which;
  }
  EXPECT_NE(images.at("held_out").at("psnr_db"), images.at("not_held_out").at("psnr_db"));
  // A camera that looks away shows nothing and is left out.
  const Json& away = images.at("cameras")[3];
  EXPECT_EQ(away.at("images"), 0);
  EXPECT_FALSE(away.contains("iou")) << away.dump(1);
  EXPECT_EQ(images.at("held_out").at("iou"), images.at("cameras")[2].at("iou"));
  for (const Json& frame : images.at("frames")) EXPECT_NE(frame.at("camera"), 3);
  const Json notes = run(document, folder.path).at("notes");
  EXPECT_THAT(notes.dump(),
              HasSubstr("camera 3, which is held out and judges nothing, is left out"));
  EXPECT_THAT(notes.dump(), Not(HasSubstr("camera 2, which is held out")));
}

TEST(CompareImages, AMatteOfSomethingElseIsSaid) {
  const Folder folder;
  film(filmed_cube(), folder.path, {two_cameras().front()});
  Json document = compared_with_clip();
  EXPECT_THAT(run(document, folder.path).dump(), Not(HasSubstr("meet the matte")));
  document["scene"]["bodies"][0]["velocity"] = {0.0, 0.0, 0.0};
  document["scene"]["bodies"][0]["placement"] = {{"position", {-0.6, 0.0, 0.0}}};
  document["output"]["folder"] = "beside";
  const Json result = run(document, folder.path);
  EXPECT_EQ(result.at("compare").at("images")[0].at("cameras")[0].at("iou"), 0.0);
  EXPECT_THAT(result.at("notes").dump(),
              HasSubstr("camera 0: in none of its images does the simulation meet the matte"));
}

/// Poses of the document, of a comparison and of pictures.
TEST(CompareImages, CamerasStandAsTheirPosesSay) {
  const Folder folder;
  std::vector<splat::Camera> cameras = two_cameras();
  film(filmed_cube(), folder.path, cameras);
  // A file that is wrong by what the poses take back.
  capture::CameraSet set = capture::read_cameras(folder.path / "clip/transforms.json");
  const Vec3d shift(0.12, -0.05, 0.1);
  for (splat::Camera& camera : set.cameras) {
    camera.translation = -(camera.rotation * (camera.centre() - shift));
  }
  write_file(folder.path / "clip/moved.json", capture::format_cameras(set));
  const Json pose = {{"shift", {shift.x(), shift.y(), shift.z()}}};
  Json document = compared_with_clip();
  const double right = run(document, folder.path).at("compare").at("images")[0].at("iou");
  document["captures"][0]["cameras"] = "clip/moved.json";
  document["output"]["folder"] = "unposed";
  EXPECT_LT(run(document, folder.path).at("compare").at("images")[0].at("iou"), right - 0.1);
  document["captures"][0]["poses"] = {pose, pose};
  document["output"]["folder"] = "posed";
  EXPECT_NEAR(run(document, folder.path).at("compare").at("images")[0].at("iou").get<double>(),
              right, 1e-3);

  document["task"] = "render";
  document["render"] = {{"capture", "clip"}, {"camera", 1}};
  document["output"]["folder"] = "pictures";
  document["scene"]["frames"] = {0, 1};
  (void)run(document, folder.path);
  document["render"] = {{"cameras", "clip/transforms.json"}, {"camera", 1}};
  document["output"]["folder"] = "straight";
  (void)run(document, folder.path);
  const auto picture = [&](const char* name) {
    return capture::read_png(folder.path / name / "render/camera_1/0000.png");
  };
  const capture::Bitmap posed = picture("pictures");
  const capture::Bitmap straight = picture("straight");
  int apart = 0;
  for (std::size_t i = 0; i < posed.rgba.size(); ++i) {
    apart = std::max(apart, std::abs(int(posed.rgba[i]) - int(straight.rgba[i])));
  }
  EXPECT_LE(apart, 2);
  document["render"] = {{"capture", "other"}};
  try {
    (void)run(document, folder.path);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no capture by images is called 'other'"));
  }
}

/// A limit that holds the simulation, and not what a fit to images needs beside it.
TEST(CompareImages, AFitThatDoesNotGoIntoTheMemoryIsRefused) {
  const Folder folder;
  Json truth = filmed_cube();
  truth["scene"]["frames"] = {0, 3};
  film(truth, folder.path, two_cameras());
  Json document = compared_with_clip();
  document["scene"]["frames"] = {0, 3};
  document["task"] = "fit";
  document["fit"] = {{"parameters", {"velocity", "material.E"}}};
  document["scene"]["solver"] = {{"memory_limit_gb", 0.008}};
  try {
    (void)run(document, folder.path);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_THAT(error.what(), HasSubstr("scene.solver.memory_limit_gb: the fit needs about"));
    EXPECT_THAT(error.what(), HasSubstr("for 6 images"));
    EXPECT_THAT(error.what(), HasSubstr("with 4 parameters"));
  }
}

}  // namespace
}  // namespace matterfit::job
