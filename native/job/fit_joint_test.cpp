// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "base/parallel.hpp"
#include "capture/ply.hpp"
#include "fit/model/parameters.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fit_experiment.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/fit_values.hpp"
#include "job/run/build_scene.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using testing::HasSubstr;

TEST(Fit, SeveralCapturesWithScenesOfTheirOwn) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  Json second = thrown_cube();
  second["scene"]["bodies"][0]["velocity"] = {-0.5, 0, -2.0};
  record(second, folder.path, "b", 2);
  Json third = thrown_cube();
  third["scene"]["bodies"][0]["velocity"] = {0, 0.5, -1};
  record(third, folder.path, "c", 3);
  Json document =
      fit_of(thrown_cube(), {"material.E", "velocity", "captures.b.bodies.cube.velocity"});
  document["scene"]["bodies"][0]["material"]["E"] = 1e5;
  document["scene"]["bodies"][0]["velocity"] = {0, 0, 0};
  const auto throws = [](const Json& velocity) {
    return Json{{"bodies", {{{"name", "cube"}, {"velocity", velocity}}}}};
  };
  document["captures"].push_back(
      {{"tracks", "b.npz"}, {"noise", 8e-4}, {"scene", throws({0, 0, -1})}});
  document["captures"].push_back({{"tracks", "c.npz"},
                                  {"noise", 8e-4},
                                  {"holdout", {{"capture", true}}},
                                  {"scene", throws({0, 0.5, -1})}});
  const Json result = run(document, folder.path);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.E") / 3e4, 1.0, 0.02);
  EXPECT_NEAR(value_of(result, "bodies.cube.velocity[0]"), 0.8, 0.01);
  EXPECT_NEAR(value_of(result, "captures.b.bodies.cube.velocity[0]"), -0.5, 0.01);
  // Seven substeps a frame, and not those of the capture: the impact is a millimetre off.
  EXPECT_NEAR(value_of(result, "captures.b.bodies.cube.velocity[2]"), -2.0, 0.02);
  // The throw that was held out is predicted.
  EXPECT_LT(result["fit"]["after"]["held_out"]["mean_mm"].get<double>(), 3.0);
  // All but its first frame, which says where the points are.
  EXPECT_EQ(result["fit"]["after"]["held_out"]["samples"], 13 * 64);
  ASSERT_EQ(result["compare"]["captures"].size(), 3U);
  ASSERT_EQ(result["runs"].size(), 2U);
  EXPECT_EQ(result["runs"][1]["folder"], "runs/c");
  EXPECT_TRUE(fs::exists(folder.path / "out/runs/c/simulated.npz"));
  const Job scene = read_job_file(folder.path / "out/scene.json");
  EXPECT_EQ(scene.captures[1].scene->bodies[0].velocity.z(),
            value_of(result, "captures.b.bodies.cube.velocity[2]"));
  EXPECT_EQ(scene.captures[2].scene->bodies[0].velocity.z(), -1.0);
  EXPECT_EQ(scene.captures[2].scene->bodies[0].material.youngs_modulus,
            value_of(result, "bodies.cube.material.E"));
}

TEST(Fit, CompareRunsScenesOfTheirOwnToo) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  Json second = thrown_cube();
  second["scene"]["gravity"] = {0, 0, -3};
  record(second, folder.path, "b", 2);
  Json document = thrown_cube();
  document["task"] = "compare";
  document["captures"] = {{{"tracks", "a.npz"}},
                          {{"tracks", "b.npz"}, {"scene", {{"gravity", {0, 0, -3}}}}}};
  const Json result = run(document, folder.path);
  ASSERT_EQ(result["compare"]["captures"].size(), 2U);
  EXPECT_LT(result["compare"]["captures"][0]["mean_mm"].get<double>(), 3.0);
  EXPECT_LT(result["compare"]["captures"][1]["mean_mm"].get<double>(), 3.0);
  EXPECT_FALSE(result["compare"].contains("mean_mm"));
  EXPECT_EQ(result["runs"][0]["captures"], Json::array({"b"}));
}

TEST(Fit, FindsTheLaw) {
  const Folder folder;
  Json truth = thrown_cube();
  truth["scene"]["bodies"][0]["material"] = {
      {"law", "von_mises"}, {"E", 6e4}, {"nu", 0.3}, {"yield_stress", 800}};
  record(truth, folder.path, "a", 1);
  Json document = fit_of(truth, {"material.E"});
  document["scene"]["bodies"][0]["material"] = {{"law", "neo_hookean"}, {"E", 3e4}, {"nu", 0.3}};
  document["captures"][0]["holdout"] = {{"frames", {11, 14}}};
  document["fit"]["laws"] = {"neo_hookean", "von_mises"};
  const Json result = run(document, folder.path);
  const Json& models = result["fit"]["models"];
  EXPECT_EQ(result["fit"]["law"], "von_mises");
  ASSERT_EQ(models.size(), 2U);
  EXPECT_EQ(models[0]["law"], "von_mises");
  EXPECT_GT(models[0]["probability"].get<double>(), 0.9);
  // The best of the wrong law is so soft that it may not run to the end.
  if (!models[1]["held_out_mm"].is_null()) {
    EXPECT_LT(models[0]["held_out_mm"].get<double>(), models[1]["held_out_mm"].get<double>());
  }
  EXPECT_NEAR(models[0]["parameters"]["bodies.cube.material.yield_stress"].get<double>() / 800.0,
              1.0, 0.1);
  const Job scene = read_job_file(folder.path / "out/scene.json");
  EXPECT_EQ(scene.scene.bodies[0].material.law, material::Law::kVonMises);
}

TEST(Fit, ALawWithNothingToFitIsRankedToo) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  Json document = fit_of(thrown_cube(), {"material.yield_stress"});
  document["scene"]["bodies"][0]["material"] = {
      {"law", "von_mises"}, {"E", 3e4}, {"nu", 0.3}, {"yield_stress", 500}};
  document["fit"]["laws"] = {"von_mises", "neo_hookean"};
  document["fit"]["iterations"] = 3;
  document["fit"]["levels"] = {1};
  const Json fit = run(document, folder.path)["fit"];
  ASSERT_EQ(fit["models"].size(), 2U);
  EXPECT_EQ(fit["models"][0]["law"], "neo_hookean") << fit["models"];
  EXPECT_EQ(fit["models"][0]["failed"], "");
  EXPECT_EQ(fit["law"], "neo_hookean");
  EXPECT_TRUE(fit["converged"].get<bool>());
  EXPECT_TRUE(fit["parameters"].empty());
  EXPECT_LT(fit["after"]["fitted"]["mean_mm"].get<double>(), 2.0);
}

TEST(Fit, CoarseLevelsComeFirst) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  Json document = fit_of(thrown_cube(), {"material.E", "velocity"});
  document["scene"]["bodies"][0]["material"]["E"] = 1e5;
  document["scene"]["bodies"][0]["velocity"] = {0, 0, 0};
  document["fit"]["levels"] = {1.6, 1};
  const Json result = run(document, folder.path);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.E") / 3e4, 1.0, 0.02);
  const Json& history = result["fit"]["history"];
  EXPECT_THAT(history.front()["stage"].get<std::string>(), HasSubstr("separation ×1.6"));
  EXPECT_EQ(history.back()["stage"], "frames 1-13");
}

/// Takes the order from the points of a recorded cloud, in each frame another one.
void shuffle(const fs::path& path, std::size_t points) {
  auto positions = capture::read_npz(path).at("positions").doubles("positions");
  const std::size_t frames = positions.size() / 3 / points;
  std::mt19937_64 generator(5);
  for (std::size_t t = 0; t < frames; ++t) {
    for (std::size_t i = points - 1; i > 0; --i) {
      const std::size_t k = generator() % (i + 1);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        std::swap(positions[3 * (t * points + i) + axis], positions[3 * (t * points + k) + axis]);
      }
    }
  }
  write_tracks(path, positions, frames, 24);
}

TEST(Fit, CloudsWithoutCorrespondence) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1, 2e-3, cloud(600));
  shuffle(folder.path / "a.npz", 600);
  Json document = fit_of(thrown_cube(), {"material.E", "material.nu"});
  document["scene"]["bodies"][0]["material"]["E"] = 1.5e5;
  document["scene"]["bodies"][0]["material"]["nu"] = 0.15;
  document["fit"]["loss"] = "chamfer";
  document["captures"][0].erase("noise");
  document["captures"][0]["holdout"] = {{"frames", {12, 14}}};
  const Json result = run(document, folder.path);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.E") / 3e4, 1.0, 0.03);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.nu"), 0.3, 0.03);
  EXPECT_THAT(result["fit"]["statements"].dump(), HasSubstr("without correspondence"));
  // What two samplings miss each other by, not what points of one index are apart.
  EXPECT_THAT(result["fit"]["statements"].dump(), HasSubstr("clouds are compared by means"));
  EXPECT_LT(result["fit"]["after"]["fitted"]["mean_mm"].get<double>(), 40.0);
  EXPECT_LT(result["fit"]["after"]["held_out"]["mean_mm"].get<double>(), 40.0);
  EXPECT_EQ(result["fit"]["after"]["held_out"]["samples"], 2 * 600);
  EXPECT_GT(result["fit"]["noise_scale"].get<double>(), 0.8);
  EXPECT_LT(result["fit"]["noise_scale"].get<double>(), 1.4);
}

// As a depth camera writes them: PLY files of differing counts, the first frames missing.
TEST(Fit, CloudsInFilesThatBeginLate) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1, 2e-3, cloud(600));
  shuffle(folder.path / "a.npz", 600);
  const auto positions = capture::read_npz(folder.path / "a.npz").at("positions").doubles("a");
  for (std::size_t t = 6; t < positions.size() / 1800; ++t) {
    const std::size_t count = 600 - 17 * (t % 3);
    std::array<std::vector<float>, 3> places;
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        places[axis].push_back(float(positions[1800 * t + 3 * i + axis]));
      }
    }
    const std::vector<capture::PlyColumn> columns{
        {"x", places[0]}, {"y", places[1]}, {"z", places[2]}};
    capture::write_ply_points(folder.path / fmt::format("cloud_{:04d}.ply", t), columns);
  }
  Json document = fit_of(thrown_cube(), {"material.E"});
  document["scene"]["bodies"][0]["material"]["E"] = 7e4;
  document["captures"] = {
      {{"tracks", {{"pattern", "cloud_####.ply"}}}, {"name", "cloud"}, {"start_frame", 6}}};
  EXPECT_THROW((void)run(document, folder.path), Error) << "no tracks";
  document["fit"]["loss"] = "chamfer";
  const Json result = run(document, folder.path);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.E") / 3e4, 1.0, 0.05);
}

TEST(Fit, CloudsOfTheSurface) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1, 2e-3, shell(600));
  shuffle(folder.path / "a.npz", 600);
  Json document = fit_of(thrown_cube(), {"material.E"});
  document["scene"]["bodies"][0]["material"]["E"] = 8e4;
  document["fit"]["loss"] = "surface";
  const Json result = run(document, folder.path);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.E") / 3e4, 1.0, 0.03);
  EXPECT_LT(result["fit"]["after"]["fitted"]["mean_mm"].get<double>(), 40.0);
}

/// What is set in the solver's scene is what the document says.
TEST(FitParameters, InTheSceneAsInTheDocument) {
  Json document = thrown_cube();
  document["scene"]["bodies"][0]["material"] = {{"law", "von_mises"},
                                                {"E", 6e4},
                                                {"nu", 0.3},
                                                {"yield_stress", 800},
                                                {"maxwell", {{{"modulus", 1e3}, {"time", 0.1}}}}};
  document["scene"]["bodies"][0]["placement"] = {{"position", {0.1, 0, 0}},
                                                 {"rotation", {0.96, 0.28, 0, 0}}};
  document["captures"] = {{{"tracks", "a.npz"}}};
  document["fit"] = {{"parameters",
                      {"material.E", "material.nu", "material.yield_stress", "material.hardening",
                       "material.damping_shear", "material.damping_bulk",
                       "material.maxwell[0].modulus", "material.maxwell[0].time", "density",
                       "velocity", "spin[1]", "placement.position", "placement.rotation", "gravity",
                       "colliders.ground.contact.mu", "colliders.ground.contact.stiffness",
                       "colliders.ground.height", "captures.a.start_frame"}}};
  const Folder folder;
  const Job job = job_of(document, folder.path);
  Arena arena(1);
  const mpm::Scene scene = build_scene(job, arena, Interrupter()).scene;
  const LoadedExperiment loaded = unread_experiment(job);
  const fit::Parameters parameters(job.fit->parameters, loaded.experiment.runs, {scene});
  std::vector<double> values = parameters.starts();
  EXPECT_EQ(values[0], 6e4);
  EXPECT_GT(values[3], 0.0);  // 0 in the document: a logarithm begins elsewhere
  for (std::size_t k = 0; k < values.size(); ++k) {
    values[k] += 0.01 * double(k + 1) * std::max(0.1, std::abs(values[k]));
  }
  mpm::Scene ours = scene;
  parameters.apply(values, 0, ours);
  Json written = job.document;
  write_values(parameters, values, loaded.sources, job, written);
  EXPECT_EQ(written["captures"][0]["start_frame"], values.back());
  EXPECT_EQ(parameters.viewing(values, 0, 0).start_frame, values.back());
  const mpm::Scene theirs = build_scene(job_of(written, folder.path), arena, Interrupter()).scene;
  const mpm::Body& a = ours.bodies[0];
  const mpm::Body& b = theirs.bodies[0];
  EXPECT_EQ(a.material.youngs_modulus, b.material.youngs_modulus);
  EXPECT_EQ(a.material.poisson_ratio, b.material.poisson_ratio);
  EXPECT_EQ(a.material.yield_stress, b.material.yield_stress);
  EXPECT_EQ(a.material.hardening, b.material.hardening);
  EXPECT_EQ(a.material.damping_shear, b.material.damping_shear);
  EXPECT_EQ(a.material.damping_bulk, b.material.damping_bulk);
  EXPECT_EQ(a.material.maxwell[0].modulus, b.material.maxwell[0].modulus);
  EXPECT_EQ(a.material.maxwell[0].time, b.material.maxwell[0].time);
  EXPECT_EQ(a.density, b.density);
  EXPECT_EQ(a.velocity, b.velocity);
  EXPECT_EQ(a.spin, b.spin);
  EXPECT_NE(a.rest[0], scene.bodies[0].rest[0]);
  ASSERT_EQ(a.rest.size(), b.rest.size());
  for (std::size_t p = 0; p < a.rest.size(); ++p) {
    EXPECT_LT((a.rest[p] - b.rest[p]).norm(), 1e-12);
  }
  EXPECT_LT((a.lattice.origin - b.lattice.origin).norm(), 1e-12);
  EXPECT_LT(a.lattice.axes.angularDistance(b.lattice.axes), 1e-12);
  EXPECT_EQ(ours.gravity.values[0], theirs.gravity.values[0]);
  EXPECT_EQ(ours.colliders[0]->contact().mu, theirs.colliders[0]->contact().mu);
  EXPECT_EQ(ours.colliders[0]->contact().stiffness, theirs.colliders[0]->contact().stiffness);
  EXPECT_EQ(ours.colliders[0]->closest(Vec3d::Zero(), 0.0).distance,
            theirs.colliders[0]->closest(Vec3d::Zero(), 0.0).distance);
}

}  // namespace
}  // namespace matterfit::job
