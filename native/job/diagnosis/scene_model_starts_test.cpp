// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "job/diagnosis/scene_model.hpp"
#include "job/fit_fixture_for_test.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;

constexpr double kHigher = 0.2;        // more, of the cube above the ground [m]
constexpr double kTracksNoise = 1e-3;  // of the cube's size
const Vec3d kThrownBy(0.8, 0.3, -1.5);
const Vec3d kTurning(1.0, -2.0, 1.5);

/// The cube in flight for ten frames and on the ground for as many.
Json falling_cube() {
  Json document = thrown_cube();
  Json& scene = document["scene"];
  scene["fps"] = 60;
  scene["frames"] = {0, 20};
  scene["particle_separation"] = 0.1;
  Json& body = scene["bodies"][0];
  body["source"]["box"] = {{"low", {0.0, 0.0, 0.1 + kHigher}}, {"high", {0.4, 0.4, 0.5 + kHigher}}};
  body["velocity"] = {kThrownBy.x(), kThrownBy.y(), kThrownBy.z()};
  body["spin"] = {kTurning.x(), kTurning.y(), kTurning.z()};
  return document;
}

/// What a fit of the cube's recording that has gone astray leaves.
Json astray() {
  Json document = falling_cube();
  document["task"] = "diagnose";
  Json& body = document["scene"]["bodies"][0];
  body["velocity"] = {2.0, 1.0, -3.0};
  body["spin"] = {-4.0, 0.0, 5.0};
  body["material"]["E"] = 3e5;
  document["captures"] = {{{"tracks", "a.npz"}, {"noise", kTracksNoise * kSize}}};
  document["fit"] = {{"parameters", {"velocity", "spin", "material.E"}}};
  return document;
}

TEST(SceneModelStarts, AreTheFirstFlightsThrowsAndTheNumbersBeforeTheFit) {
  const Folder folder;
  Points points = markers();
  for (Vec3d& x : points) x.z() += kHigher;
  record(falling_cube(), folder.path, "a", 5, kTracksNoise, points);
  std::vector<std::string> statements;
  const Interrupter interrupter;
  const Job job = job_of(astray(), folder.path);
  SceneModel model(job, SceneModel::From::kDocument, {}, interrupter, statements, true);
  ASSERT_FALSE(model.corrections().empty());
  EXPECT_TRUE(model.other_starts().empty());
  constexpr double kBefore = 2e4;
  model.begin_also_from({0.0, 0.0, 0.0, 0.0, 0.0, 0.0, kBefore});
  const std::vector<Eigen::VectorXd> starts = model.other_starts();
  ASSERT_EQ(starts.size(), 4U);
  const auto stiffness = [](const Eigen::VectorXd& theta) { return std::exp(theta[6]); };
  for (const Eigen::VectorXd& theta : starts) {
    ASSERT_EQ(theta.size(), Eigen::Index(model.parameters().size()));
    EXPECT_LT((theta.head<3>() - kThrownBy).norm(), 0.02);
    EXPECT_LT((theta.segment<3>(3) - kTurning).norm(), 0.05);
    EXPECT_TRUE(theta.tail(theta.size() - 7).isZero(0.0));
  }
  EXPECT_NEAR(stiffness(starts[0]), 3e5, 1.0);
  EXPECT_NEAR(stiffness(starts[1]), kBefore, 0.1);
  EXPECT_NEAR(stiffness(starts[2]), 4.0 * kBefore, 0.1);
  EXPECT_NEAR(stiffness(starts[3]), kBefore / 4.0, 0.1);
}

/// A body that meets nothing is fitted well as it is.
TEST(SceneModelStarts, AFlightHasNoOthers) {
  const Folder folder;
  Json truth = falling_cube();
  truth["scene"].erase("colliders");
  Points points = markers();
  for (Vec3d& x : points) x.z() += kHigher;
  record(truth, folder.path, "a", 5, kTracksNoise, points);
  Json document = astray();
  document["scene"].erase("colliders");
  std::vector<std::string> statements;
  const Interrupter interrupter;
  const Job job = job_of(document, folder.path);
  SceneModel model(job, SceneModel::From::kDocument, {}, interrupter, statements, true);
  model.begin_also_from({0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2e4});
  EXPECT_TRUE(model.other_starts().empty());
}

}  // namespace
}  // namespace matterfit::job
