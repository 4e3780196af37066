// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "fit/data/camera_pose.hpp"
#include "job/clip_for_test.hpp"

/// Fits to images whose cameras stand otherwise than their file says, and beside tracks.
namespace matterfit::job {
namespace {

using namespace fit_test;

/// A cube that is thrown past cameras that stand near, one of which is not where its file says.
constexpr double kDegree = std::numbers::pi / 180.0;

std::vector<splat::Camera> near_cameras() {
  std::vector<splat::Camera> cameras = {looking(Vec3d(0.6, -1.3, 0.7), kFlightMiddle),
                                        looking(Vec3d(1.5, 0.4, 0.5), kFlightMiddle),
                                        looking(Vec3d(-0.5, 1.2, 0.9), kFlightMiddle)};
  for (splat::Camera& camera : cameras) camera.fx = camera.fy = 0.75 * kClipWidth;
  return cameras;
}

fit::CameraPose wrong_pose() {
  fit::CameraPose pose;
  pose.shift = 0.02 * Vec3d(0.6, 0.64, -0.48);
  pose.turn = kDegree * Vec3d(0.48, -0.8, 0.36);
  return pose;
}

Json fit_with_poses(const std::vector<std::string>& parameters, const std::string& cameras) {
  Json document = thrown_cube();
  document["task"] = "fit";
  Json& body = document["scene"]["bodies"][0];
  body["material"]["E"] = 9e4;
  body["velocity"] = {0.6, 0.4, -1.3};
  document["captures"] = Json::array({{{"cameras", cameras}, {"name", "clip"}, {"noise", 0.3}}});
  document["fit"] = {{"parameters", parameters}};
  return document;
}

/// A file that says of the second camera what it is not: what was filmed stands in `wrong_pose()`
/// against it.
void write_wrong_cameras(const fs::path& folder) {
  capture::CameraSet set = capture::read_cameras(folder / "clip/transforms.json");
  const fit::CameraPose pose = wrong_pose();
  splat::Camera& camera = set.cameras[1];
  const Vec3d centre = camera.centre() - pose.shift;
  camera.rotation = Eigen::AngleAxisd(pose.turn.norm(), pose.turn.normalized()).toRotationMatrix() *
                    camera.rotation;
  camera.translation = -(camera.rotation * centre);
  write_file(folder / "clip/wrong.json", capture::format_cameras(set));
}

TEST(ImagePoses, ACameraThatWasTurnedAndMovedIsFoundWithTheStiffness) {
  const Folder folder;
  film(filmed_cube(), folder.path, near_cameras(), drawn);
  write_wrong_cameras(folder.path);
  const Json right =
      run(fit_with_poses({"velocity", "material.E"}, "clip/transforms.json"), folder.path);
  Json document = fit_with_poses(
      {"velocity", "material.E", "captures.clip.poses[1].shift", "captures.clip.poses[1].turn"},
      "clip/wrong.json");
  document["output"]["folder"] = "refined";
  const Json refined = run(document, folder.path);
  const fit::CameraPose truth = wrong_pose();
  fit::CameraPose found;
  for (int k = 0; k < 3; ++k) {
    const std::string component = "[" + std::to_string(k) + "]";
    found.shift[k] = value_of(refined, "captures.clip.poses[1].shift" + component);
    found.turn[k] = value_of(refined, "captures.clip.poses[1].turn" + component);
  }
  EXPECT_LT((found.shift - truth.shift).norm(), 0.5 * truth.shift.norm()) << found.shift;
  EXPECT_LT((found.turn - truth.turn).norm(), 0.5 * truth.turn.norm()) << found.turn;
  const double stiffness = value_of(right, "bodies.cube.material.E");
  EXPECT_NEAR(value_of(refined, "bodies.cube.material.E"), stiffness, 0.02 * stiffness);
  const auto iou = [](const Json& result) {
    return result.at("fit").at("silhouettes").at("after").at("fitted").at("iou").get<double>();
  };
  EXPECT_NEAR(iou(refined), iou(right), 0.005);
  const Json& fitted = refined.at("fit").at("cameras")[1].at("fitted");
  EXPECT_GT(fitted.at("iou").get<double>(), 0.95);
}

}  // namespace
}  // namespace matterfit::job
