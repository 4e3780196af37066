// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
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

/// Sectors about the vertical axis, of two brightnesses by height.
Vec3d painted(const Vec3d& rest) {
  const Vec3d x = rest - kCentre;
  const double angle = std::atan2(x.y(), x.x());
  const double wave = 0.5 + 0.35 * std::sin(3.0 * angle);
  return {wave, x.z() > 0.0 ? 0.7 : 0.3, 1.0 - wave};
}

Json fit_to_clip(const Json& colours) {
  Json document = spinning_ball(0.05);
  document["task"] = "fit";
  document["captures"] = Json::array({{{"cameras", "clip/transforms.json"}, {"noise", 0.3}}});
  document["captures"][0]["colours"] = colours;
  document["captures"][0]["holdout"] = {{"frames", {12, 14}}};
  document["fit"] = {{"parameters", {"velocity", "spin[2]"}}};
  return document;
}

TEST(ImageColours, TellASpinThatMasksLeaveUnknown) {
  const Folder folder;
  Json truth = spinning_ball(0.04);
  truth["scene"]["bodies"][0]["spin"] = {0, 0, kSpin};
  const std::vector<splat::Camera> cameras = {looking(Vec3d(0.4, -1.4, 0.6), kCentre),
                                              looking(Vec3d(1.8, 0.3, 0.5), kCentre)};
  film(truth, folder.path, cameras, painted);
  const auto spin_of = [&](const Json& colours, const std::string& out) {
    Json document = fit_to_clip(colours);
    document["output"]["folder"] = out;
    const Json result = run(document, folder.path);
    for (const Json& parameter : result.at("fit").at("parameters")) {
      if (parameter.at("path") == "bodies.ball.spin[2]") {
        std::cout << result.at("fit").dump(1) << "\n";
        return parameter;
      }
    }
    throw_input("the result has no spin");
  };
  const Json seen = spin_of(true, "seen");
  EXPECT_NEAR(seen.at("value").get<double>(), kSpin, 0.1 * kSpin);
  EXPECT_EQ(seen.at("observable"), true);
  const Json blind = spin_of(false, "blind");
  EXPECT_GT(blind.at("standard_error").get<double>(), 10 * seen.at("standard_error").get<double>());
  EXPECT_GT(std::abs(blind.at("value").get<double>() - kSpin), 0.3 * kSpin);
}

TEST(ImageColours, WithoutTheFirstFrameNothingSaysThem) {
  const Folder folder;
  film(spinning_ball(0.04), folder.path, {looking(Vec3d(0.4, -1.4, 0.6), kCentre)}, painted);
  Json document = fit_to_clip(true);
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
