// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "bake/picture.hpp"
#include "capture/carried_splats.hpp"
#include "capture/image_file.hpp"
#include "capture/spz_for_test.hpp"
#include "job/clip_for_test.hpp"

/// Bodies that are seen by splats of their own.
namespace matterfit::job {
namespace {

using namespace fit_test;

const Vec3d kBallCentre(0.2, 0.1, 0.3);
constexpr double kBallRadius = 0.2;
constexpr double kBallSpin = 3.0;  // [rad/s] about the vertical, 93° over the clip

/// A ball of splats, of colours by their place that change a little with the direction they are
/// seen from.
capture::Splats coloured_ball() {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
  capture::Splats splats;
  splats.sh_degree = 1;
  while (splats.size() < 900) {
    const Vec3f x(uniform(random), uniform(random), uniform(random));
    if (x.norm() > 1.0F) continue;
    splats.means.push_back(kBallCentre.cast<float>() + float(0.9 * kBallRadius) * x);
    splats.rotations.push_back(Eigen::Quaternionf(1.0F, x.x(), x.y(), x.z()).normalized());
    splats.scales.emplace_back(0.03F, 0.02F, 0.025F);
    splats.opacities.push_back(0.9F);
    const float wave = 0.8F * std::sin(std::atan2(x.y(), x.x()));
    const float above = x.z() > 0.0F ? 0.5F : -0.5F;
    splats.sh.insert(splats.sh.end(), {wave, above, -wave});
    for (int k = 0; k < 9; ++k) splats.sh.push_back(0.1F * uniform(random));
  }
  return splats;
}

Json ball_of_splats(double separation) {
  Json document = Json::parse(R"({ "schema": "matterfit.job/1", "task": "simulate",
    "scene": { "fps": 24, "frames": [0, 14], "gravity": [0, 0, 0],
      "bodies": [ { "name": "ball", "density": 1000, "velocity": [0.2, 0.1, 0],
        "placement": { "rotation": [0.9238795, 0, 0, 0.3826834] },
        "source": { "gaussians": "../ball.ply" },
        "material": { "law": "neo_hookean", "E": 1e5, "nu": 0.3 } } ] } })");
  document["scene"]["particle_separation"] = separation;
  return document;
}

Json fit_to_splats() {
  Json document = ball_of_splats(0.05);
  document["scene"]["bodies"][0]["source"]["gaussians"] = "ball.ply";
  document["task"] = "fit";
  document["captures"] = Json::array({{{"cameras", "clip/transforms.json"}}});
  document["captures"][0]["colours"] = {{"noise", 0.03}};
  document["captures"][0]["holdout"] = {{"frames", {12, 14}}};
  document["fit"] = {{"parameters", {"velocity", "spin[2]"}}};
  return document;
}

/// A clip of the ball that spins, drawn by the splats that particles of another separation carry.
std::vector<splat::Camera> film_ball(const fs::path& folder) {
  const capture::Splats splats = coloured_ball();
  capture::write_splats(folder / "ball.ply", splats);
  Json truth = ball_of_splats(0.04);
  truth["scene"]["bodies"][0]["spin"] = {0, 0, kBallSpin};
  const Quatd turn(0.9238795, 0, 0, 0.3826834);
  const Vec3d centre = turn * kBallCentre;
  std::vector<splat::Camera> cameras = {looking(centre + Vec3d(0.2, -1.5, 0.3), centre),
                                        looking(centre + Vec3d(1.6, 0.2, 0.2), centre)};
  film(truth, folder, cameras, [&](const auto& scene, const auto& state, const auto& camera) {
    Arena arena(2);
    const mpm::Body& body = scene.bodies.front();
    const capture::CarriedSplats carried(capture::placed(splats, Vec3d::Zero(), turn, 1.0), body,
                                         0.5 * scene.dx, arena);
    const capture::ParticleView view =
        capture::particle_view(body, state.bodies.front(), 0.5 * scene.dx);
    return bake::picture(splat::render(carried.at(view, arena), camera), std::nullopt);
  });
  return cameras;
}

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
