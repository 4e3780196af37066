// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "capture/image_file.hpp"
#include "capture/spz_for_test.hpp"
#include "job/clip_for_test.hpp"
#include "job/splat_ball_for_test.hpp"

/// Bodies that are seen by splats of their own.
namespace matterfit::job {
namespace {

using namespace fit_test;

/// The outline of a ball of many splats tells little of its spin.
TEST(ImageSplats, TellTheSpinByTheirOwnColours) {
  const Folder folder;
  (void)film_ball(folder.path);
  const Json result = run(fit_to_splats(), folder.path);
  const Json& fit = result.at("fit");
  EXPECT_NEAR(value_of(result, "bodies.ball.spin[2]"), kBallSpin, 0.03 * kBallSpin) << fit.dump(1);
  EXPECT_NEAR(value_of(result, "bodies.ball.velocity[0]"), 0.2, 0.01);
  EXPECT_NEAR(value_of(result, "bodies.ball.velocity[1]"), 0.1, 0.01);
  EXPECT_LT(fit.at("noise_scales").at("colours").get<double>(), 0.5);
  EXPECT_TRUE(fit.at("cameras")[0].at("particle_size").is_null());
  EXPECT_GT(fit.at("silhouettes").at("after").at("held_out").at("iou").get<double>(), 0.97);
}

/// Splats are as wide as the pixels of a recording blur them, whatever pixels a fit compares.
TEST(ImageSplats, TheTruthIsTheMinimumInImagesOfAnySize) {
  for (const int finer : {1, 3}) {
    const Folder folder;
    (void)film_ball(folder.path, finer);
    Json document = fit_to_splats();
    document["scene"]["particle_separation"] = 0.04;  // the clip's own
    document["scene"]["bodies"][0]["spin"] = {0, 0, kBallSpin};
    document["captures"][0].erase("colours");
    document["fit"] = {{"parameters", {"velocity"}}, {"iterations", 4}};
    const Json result = run(document, folder.path);
    const Json& fit = result.at("fit");
    EXPECT_LT(fit.at("noise_scales").at("images").get<double>(), 0.05) << finer;
    EXPECT_NEAR(value_of(result, "bodies.ball.velocity[0]"), 0.2, 1e-3) << finer;
    EXPECT_NEAR(value_of(result, "bodies.ball.velocity[1]"), 0.1, 1e-3) << finer;
    for (const char* when : {"before", "after"}) {
      const Json& outlines = fit.at("silhouettes").at(when).at("fitted");
      EXPECT_GT(outlines.at("iou").get<double>(), 0.995) << finer << when;
    }
  }
}

/// Nothing is taken from the first frame, which may be held out or not be there.
TEST(ImageSplats, NeedNoFirstFrameAndAreCompared) {
  const Folder folder;
  (void)film_ball(folder.path);
  Json document = fit_to_splats();
  document["task"] = "compare";
  document["captures"][0]["holdout"] = {{"frames", {0, 2}}};
  document.erase("fit");
  const auto psnr = [&](double spin, const char* out) {
    document["scene"]["bodies"][0]["spin"] = {0, 0, spin};
    document["output"]["folder"] = out;
    const Json images = run(document, folder.path).at("compare").at("images")[0];
    return images.at("not_held_out").at("psnr_db").get<double>();
  };
  const double there = psnr(kBallSpin, "true");
  EXPECT_GT(there, 32.0);
  EXPECT_LT(psnr(0.5 * kBallSpin, "half"), there - 6.0);
}

/// One small Gaussian before the camera, as SPZ says whether it was trained with antialiasing.
TEST(ImageSplats, AntialiasedFilesAreDrawnSo) {
  const Folder folder;
  using capture::spz_test::Bytes;
  const auto file_of = [](std::uint8_t flags) {
    Bytes bytes = capture::spz_test::spz_header(2, 1, 0, flags);
    const auto add = [&](const Bytes& more) {
      bytes.insert(bytes.end(), more.begin(), more.end());
    };
    add(Bytes(9, 0));      // at the origin
    add({255});            // opaque
    add({255, 255, 255});  // white
    add({80, 80, 80});     // e^(80/16 − 10) m
    add({128, 128, 128});  // not turned
    return capture::spz_test::gzip(bytes);
  };
  capture::CameraSet set;
  set.cameras = {looking(Vec3d(0, -4, 0), Vec3d::Zero())};
  capture::Shot shot;
  shot.image = "none.png";
  set.shots = {shot};
  write_file(folder.path / "cameras.json", capture::format_cameras(set));
  const auto covered = [&](std::uint8_t flags, const std::string& name) {
    const std::vector<std::byte> bytes = file_of(flags);
    write_file(folder.path / (name + ".spz"),
               std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
    const Json document = {{"schema", "matterfit.job/1"},
                           {"task", "render"},
                           {"render", {{"cameras", "cameras.json"}, {"gaussians", name + ".spz"}}},
                           {"output", {{"folder", name}}}};
    (void)run(document, folder.path);
    const capture::Bitmap image = capture::read_image(folder.path / name / "render/camera_0.png");
    double sum = 0.0;
    for (std::size_t i = 0; i < image.pixels(); ++i) sum += image.rgba[4 * i + 3] / 255.0;
    return sum;
  };
  const double plain = covered(0, "plain");
  const double antialiased = covered(1, "antialiased");
  EXPECT_GT(plain, 0.0);
  EXPECT_LT(antialiased, 0.7 * plain);
}

}  // namespace
}  // namespace matterfit::job
