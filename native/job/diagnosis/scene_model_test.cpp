// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/scene_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "job/diagnosis/report_for_test.hpp"
#include "job/fit_fixture_for_test.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;

/// A column of liquid, 864 particles, that runs out over a floor.
Json running_column(const Json& contact) {
  return Json::parse(R"({ "schema": "matterfit.job/1", "task": "simulate",
    "scene": { "fps": 50, "frames": [0, 22], "particle_separation": 0.03,
      "bodies": [ { "name": "liquid", "density": 1000,
        "source": { "box": { "low": [0, 0, 0], "high": [0.24, 0.12, 0.8] } },
        "material": { "law": "newtonian", "bulk_modulus": 5e4, "viscosity": 5 } } ],
      "walls": { "low": [0, 0, null], "high": [null, 0.12, null],
                 "contact": { "kind": "separating" } },
      "colliders": [ { "name": "floor", "shape": "ground", "contact": )" +
                     contact.dump() + "} ] } }");
}

/// What the truth's front does, with noise, as `front.npz`.
void record_front(const Json& truth, const fs::path& folder, double noise) {
  const auto range = truth["scene"]["frames"].get<std::vector<int>>();
  const auto frames = static_cast<std::size_t>(range[1] - range[0]);
  const double fps = truth["scene"]["fps"].get<double>();
  const fs::path work = folder / "truth";
  fs::create_directories(work);
  write_tracks(work / "still.npz", std::vector<double>(3 * frames, 0.0), frames, fps);
  Json document = truth;
  document["captures"] = {{{"tracks", "still.npz"}, {"front", {1, 0, 0}}}};
  (void)run(document, work);
  auto positions =
      capture::read_npz(work / "out/simulated.npz").at("positions").doubles("positions");
  std::mt19937_64 generator(3);
  std::normal_distribution<double> normal(0.0, noise);
  for (std::size_t f = 0; f < frames; ++f) positions[3 * f] += normal(generator);
  write_tracks(folder / "front.npz", positions, frames, fps);
}

Json front_job(const Json& scene_of, double noise) {
  Json document = scene_of;
  document["task"] = "diagnose";
  document["captures"] = {{{"tracks", "front.npz"},
                           {"front", {1, 0, 0}},
                           {"noise", noise},
                           {"holdout", {{"frames", {17, 22}}}}}};
  document["fit"] = {{"parameters", {"material.viscosity"}}};
  document["diagnose"] = {{"members", 12}};
  return document;
}

/// A floor that the scene takes to hold what touches it lets it go: the front alone says so.
TEST(Diagnose, AFloorThatDoesNotHoldIsFoundFromTheFront) {
  constexpr double kNoise = 2e-3;
  const Folder folder;
  record_front(running_column({{"kind", "friction"}, {"mu", 0.0}}), folder.path, kNoise);
  const Json report = run(front_job(running_column({{"kind", "glue"}}), kNoise), folder.path);
  EXPECT_TRUE(names(report, "contact_kind")) << report.at("sentence");
  ASSERT_TRUE(report.contains("model")) << report.at("sentence");
  EXPECT_EQ(report["model"]["colliders"][0]["contact"]["kind"], "friction");
  EXPECT_GT(cause_of(report, "contact_kind").at("gain").get<double>(), 0.5);
}

/// The grid of updated bodies lies in the world, so everything else is moved against it; what is
/// seen stays where it is, but for what the grid changes.
TEST(SceneModel, MovesTheWorldUnderUpdatedBodies) {
  constexpr double kNoise = 2e-3;
  const Folder folder;
  const Json scene = running_column({{"kind", "friction"}, {"mu", 0.2}});
  record_front(scene, folder.path, kNoise);
  std::vector<std::string> statements;
  const Interrupter interrupter;
  const Job job = job_of(front_job(scene, kNoise), folder.path);
  const SceneModel model(job, SceneModel::From::kDocument, {}, interrupter, statements);
  diagnose::Point point;
  point.theta.resize(Eigen::Index(model.parameters().size()));
  for (std::size_t k = 0; k < model.parameters().size(); ++k) {
    point.theta[Eigen::Index(k)] = model.parameters()[k].start;
  }
  diagnose::Point moved = point;
  moved.numerics.offset = Vec3d(0.37, 0.61, 0.43);
  const auto motions = model.simulate({point, moved});
  ASSERT_TRUE(motions[0] && motions[1]);
  const Eigen::VectorXd apart = motions[1]->positions - motions[0]->positions;
  EXPECT_LT(apart.head(3).norm(), 1e-6);
  EXPECT_GT(apart.lpNorm<Eigen::Infinity>(), 1e-5);
  EXPECT_LT(apart.lpNorm<Eigen::Infinity>(), 0.08);
}

}  // namespace
}  // namespace matterfit::job
