// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "job/clip_for_test.hpp"

/// Fits to the colours of images beside their mattes.
namespace matterfit::job {
namespace {

using namespace fit_test;
using ::testing::HasSubstr;

const Vec3d kCentre(0.2, 0.1, 0.3);
constexpr double kSpin = 3.0;  // [rad/s] about the vertical, 93° over the clip

/// A ball that flies and spins about an axis of symmetry.
Json spinning_ball(double separation) {
  Json document = Json::parse(R"({ "schema": "matterfit.job/1", "task": "simulate",
    "scene": { "fps": 24, "frames": [0, 14], "gravity": [0, 0, 0],
      "bodies": [ { "name": "ball", "density": 1000, "velocity": [0.2, 0.1, 0],
        "source": { "sphere": { "center": [0.2, 0.1, 0.3], "radius": 0.2 } },
        "material": { "law": "neo_hookean", "E": 1e5, "nu": 0.3 } } ] } })");
  document["scene"]["particle_separation"] = separation;
  return document;
}

/// Brighter to one side of the vertical axis, and above.
Vec3d painted(const Vec3d& rest) {
  const Vec3d x = rest - kCentre;
  const double angle = std::atan2(x.y(), x.x());
  const double wave = 0.5 + 0.35 * std::sin(angle);
  return {wave, x.z() > 0.0 ? 0.7 : 0.3, 1.0 - wave};
}

capture::Bitmap coloured(const mpm::Scene& scene, const mpm::FrameState& state,
                         const splat::Camera& camera) {
  return paint(scene, state, camera, painted);
}

Json fit_to_colours(const Json& colours) {
  Json document = spinning_ball(0.05);
  document["task"] = "fit";
  document["captures"] = Json::array({{{"cameras", "clip/transforms.json"}}});
  document["captures"][0]["colours"] = colours;
  document["captures"][0]["holdout"] = {{"frames", {12, 14}}};
  document["fit"] = {{"parameters", {"velocity", "spin[2]"}}};
  return document;
}

/// The masks of a ball of particles tell a spin that is not there: the lattice has corners.
TEST(ImageColours, TellASpinThatMasksLeaveUnknown) {
  const Folder folder;
  Json truth = spinning_ball(0.04);
  truth["scene"]["bodies"][0]["spin"] = {0, 0, kSpin};
  const std::vector<splat::Camera> cameras = {looking(Vec3d(0.4, -1.4, 0.6), kCentre),
                                              looking(Vec3d(1.8, 0.3, 0.5), kCentre)};
  film(truth, folder.path, cameras, coloured);
  const auto fit_with = [&](const Json& colours, const std::string& out) {
    Json document = fit_to_colours(colours);
    document["output"]["folder"] = out;
    return run(document, folder.path);
  };
  const Json seen = fit_with({{"noise", 0.03}}, "seen");
  EXPECT_NEAR(value_of(seen, "bodies.ball.spin[2]"), kSpin, 0.2 * kSpin) << seen.at("fit").dump(1);
  EXPECT_LT(seen.at("fit").at("noise_scales").at("colours").get<double>(), 2.0);
  const Json blind = fit_with(false, "blind");
  EXPECT_GT(std::abs(value_of(blind, "bodies.ball.spin[2]") - kSpin), 0.4 * kSpin);
  EXPECT_TRUE(blind.at("fit").at("noise_scales").at("colours").is_null());
}

TEST(ImageColours, WithoutTheFirstFrameNothingSaysThem) {
  const Folder folder;
  film(spinning_ball(0.04), folder.path, {looking(Vec3d(0.4, -1.4, 0.6), kCentre)}, coloured);
  Json document = fit_to_colours(true);
  document["captures"][0]["holdout"] = {{"frames", {0, 2}}};
  try {
    (void)run(document, folder.path);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("shows the colours of the body at the scene's first frame"));
  }
}

}  // namespace
}  // namespace matterfit::job
