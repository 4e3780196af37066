// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>

#include "base/file.hpp"
#include "base/message_for_test.hpp"
#include "job/fit_files.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/fit_progress.hpp"
#include "job/fit_state.hpp"
#include "job/run/inspect.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using testing::HasSubstr;

TEST(Fit, FindsStiffnessAndVelocityInNoisyTracks) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const Folder folder;
    record(thrown_cube(), folder.path, "a", seed);
    Json document = poor_start();
    document["captures"][0]["holdout"] = {{"frames", {11, 14}}};
    const Json result = run(document, folder.path);
    const Json& fit = result["fit"];
    EXPECT_EQ(result["status"], "done");
    EXPECT_EQ(result["task"], "fit");
    EXPECT_TRUE(fit["converged"].get<bool>()) << fit["reason"];
    EXPECT_NEAR(value_of(result, "bodies.cube.material.E") / 3e4, 1.0, 0.02) << "seed " << seed;
    EXPECT_NEAR(value_of(result, "bodies.cube.velocity[0]"), 0.8, 0.01);
    EXPECT_NEAR(value_of(result, "bodies.cube.velocity[1]"), 0.3, 0.01);
    EXPECT_NEAR(value_of(result, "bodies.cube.velocity[2]"), -1.5, 0.01);
    // Errors as they should be of such noise, and one that the truth lies within.
    const Json& stiffness = fit["parameters"][0];
    const double error = stiffness["standard_error"].get<double>();
    EXPECT_GT(error, 3.0);
    EXPECT_LT(error, 600.0);
    EXPECT_TRUE(stiffness["observable"].get<bool>());
    EXPECT_GT(fit["noise_scale"].get<double>(), 0.7);
    EXPECT_LT(fit["noise_scale"].get<double>(), 2.0);
    for (const char* part : {"fitted", "held_out"}) {
      EXPECT_LT(fit["after"][part]["mean_mm"].get<double>(), 3.0);
      EXPECT_LT(fit["after"][part]["mean_mm"].get<double>(),
                0.1 * fit["before"][part]["mean_mm"].get<double>());
    }
    EXPECT_GT(fit["history"].size(), 3U);
  }
}

/// The motion that the first frames show is none that the body was thrown with, and a material that
/// is wrong likes it better than the true one.
TEST(Fit, FindsAThrowThatHitsWithinTheFirstFrame) {
  Json truth = thrown_cube();
  Json& body = truth["scene"]["bodies"][0];
  body["material"] = {{"law", "von_mises"}, {"E", 1e5}, {"nu", 0.3}, {"yield_stress", 4e3}};
  body["velocity"] = {0.8, 0.3, -3.5};
  const Folder folder;
  record(truth, folder.path, "a", 1);
  Json document = fit_of(truth, {"material.E", "material.yield_stress", "velocity"});
  Json& start = document["scene"]["bodies"][0]["material"];
  start["E"] = 4e5;
  start["yield_stress"] = 2e4;
  const Json result = run(document, folder.path);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.E") / 1e5, 1.0, 0.05);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.yield_stress") / 4e3, 1.0, 0.05);
  EXPECT_NEAR(value_of(result, "bodies.cube.velocity[2]"), -3.5, 0.05);
  EXPECT_THAT(result["fit"]["statements"].dump(), HasSubstr("are no rigid flight"));
  EXPECT_EQ(result["fit"]["warning"], "");
}

TEST(Fit, FindsWhenARecordingBegan) {
  const Folder folder;
  Json truth = thrown_cube();
  truth["scene"]["bodies"][0]["velocity"] = {0.8, 0.3, 1.5};  // still in the air after 6 frames
  record(truth, folder.path, "late", 1);
  // Its clock began .4 of a frame after the throw: what lies between frames is read off a parabola.
  const auto all = capture::read_npz(folder.path / "late.npz").at("positions").doubles("p");
  const std::size_t row = 3 * markers().size();
  constexpr double kLate = 0.4;
  std::vector<double> positions;
  for (std::size_t t = 0; t < 4; ++t) {
    for (std::size_t i = 0; i < row; ++i) {
      const double a = all[t * row + i];
      const double b = all[(t + 1) * row + i];
      const double fall = i % 3 == 2 ? -9.81 / 24.0 / 24.0 : 0.0;
      positions.push_back(a + kLate * (b - a) - 0.5 * kLate * (1.0 - kLate) * fall);
    }
  }
  write_tracks(folder.path / "a.npz", positions, 4, 24);
  Json document = fit_of(truth, {"captures.a.start_frame"});
  document["scene"]["frames"] = {0, 6};
  document["captures"][0]["positions"] = Json::array();
  for (const Vec3d& x : markers()) {
    document["captures"][0]["positions"].push_back({x.x(), x.y(), x.z()});
  }
  const Json result = run(document, folder.path);
  EXPECT_NEAR(value_of(result, "captures.a.start_frame"), kLate, 0.02);
  EXPECT_LT(result["fit"]["after"]["fitted"]["mean_mm"].get<double>(), 2.0);
}

TEST(Fit, TheFittedSceneIsAJobAndTheMaterialAPreset) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  const Json result = run(poor_start(), folder.path);
  const fs::path out = folder.path / "out";
  for (const char* name : {"material.json", "scene.json", "fit/history.jsonl", "fit/fitted.json",
                           "simulated.npz", "compare.npz", "result.json", "manifest.json"}) {
    EXPECT_TRUE(fs::exists(out / name)) << name;
  }
  EXPECT_FALSE(fs::exists(out / kFitCheckpointPath));
  Job scene = read_job_file(out / "scene.json");
  EXPECT_EQ(scene.task, Task::kSimulate);
  EXPECT_EQ(scene.output.folder, out);
  EXPECT_EQ(scene.scene.bodies[0].material.youngs_modulus,
            value_of(result, "bodies.cube.material.E"));
  EXPECT_EQ(scene.scene.bodies[0].velocity.x(), value_of(result, "bodies.cube.velocity[0]"));
  // It is what the folder holds.
  Interrupter interrupter;
  const Json again = run_job(scene, RunOptions{}, interrupter);
  EXPECT_EQ(again["frames_reused"], 14);
  EXPECT_EQ(again["fit"]["parameters"], result["fit"]["parameters"]);
  const auto bytes = read_file(out / "material.json");
  const Json material = Json::parse(reinterpret_cast<const char*>(bytes.data()),
                                    reinterpret_cast<const char*>(bytes.data()) + bytes.size());
  EXPECT_EQ(material["schema"], "matterfit.material/1");
  EXPECT_EQ(material["material"]["law"], "neo_hookean");
  EXPECT_EQ(material["material"]["E"], value_of(result, "bodies.cube.material.E"));
  EXPECT_EQ(material["density"], 1000.0);
  EXPECT_EQ(material["provenance"]["captures"][0]["name"], "a");
  EXPECT_TRUE(inspect_folder(out)["faults"].empty());
  std::ifstream history(out / "fit/history.jsonl");
  std::string line;
  std::size_t lines = 0;
  while (std::getline(history, line)) {
    EXPECT_EQ(Json::parse(line), result["fit"]["history"][lines]);
    ++lines;
  }
  EXPECT_EQ(lines, result["fit"]["history"].size());
  // A fit that is done is not done again.
  EXPECT_EQ(bits(run(poor_start(), folder.path)), bits(result));
}

TEST(Fit, NeverSeesWhatIsHeldOut) {
  const auto fitted = [](const std::string& name, const std::function<void(Json&)>& hold,
                         const std::function<bool(std::size_t, std::size_t)>& is_held) {
    std::string first;
    for (const bool garbage : {false, true}) {
      const Folder folder;
      record(thrown_cube(), folder.path, "a", 1);
      if (garbage) {
        auto positions =
            capture::read_npz(folder.path / "a.npz").at("positions").doubles("positions");
        std::mt19937_64 generator(7);
        std::normal_distribution<double> normal(0.0, 1.0);
        for (std::size_t k = 0; k < positions.size(); ++k) {
          if (is_held(k / 3 / 64, k / 3 % 64)) positions[k] = normal(generator);
        }
        write_tracks(folder.path / "a.npz", positions, 14, 24);
      }
      Json document = poor_start();
      document["captures"][0].erase("noise");  // its estimate must not see it either
      hold(document["captures"][0]["holdout"]);
      const std::string found = bits(run(document, folder.path));
      if (garbage) {
        EXPECT_EQ(found, first) << name;
      } else {
        first = found;
      }
    }
  };
  fitted(
      "frames",
      [](Json& holdout) {
        holdout = {{"frames", {10, 14}}};
      },
      [](std::size_t t, std::size_t) { return t >= 10; });
  fitted(
      "tracks",
      [](Json& holdout) {
        holdout = {{"tracks", {0, 5, 63}}};
      },
      [](std::size_t, std::size_t i) { return i == 0 || i == 5 || i == 63; });
}

TEST(Fit, ContactsFollowTheMaterialFromAFarStart) {
  Json truth = thrown_cube();
  truth["scene"]["colliders"][0]["contact"].erase("stiffness");
  const Json document = of_the_wrong_law();
  const Folder folder;
  record(truth, folder.path, "a", 1);
  const Json result = run(document, folder.path);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.E") / 3e4, 1.0, 0.02);
}

TEST(Fit, OtherInputsAreRefusedUntilRestart) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  (void)run(poor_start(), folder.path);
  Json document = poor_start();
  document["captures"][0]["holdout"] = {{"frames", {12, 14}}};
  EXPECT_THAT(message_of([&] { (void)run(document, folder.path); }),
              HasSubstr("captures[0].holdout.frames[0]: 12.0, was not there"));
  const Json result = run(document, folder.path, 2, Restart::kAlways);
  EXPECT_EQ(result["status"], "done");
  EXPECT_EQ(result["fit"]["after"]["held_out"]["samples"], 128);
}

TEST(Fit, SaysWhatNothingObserves) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  Json document = fit_of(thrown_cube(), {"material.E", "colliders.wall.contact.mu"});
  document["scene"]["colliders"].push_back(
      {{"name", "wall"}, {"shape", "plane"}, {"point", {9, 0, 0}}, {"normal", {-1, 0, 0}}});
  const Json fit = run(document, folder.path)["fit"];
  EXPECT_TRUE(fit["parameters"][0]["observable"].get<bool>());
  EXPECT_FALSE(fit["parameters"][1]["observable"].get<bool>());
  EXPECT_TRUE(fit["parameters"][1]["standard_error"].is_null());
  EXPECT_THAT(fit["parameters"][1]["statement"].get<std::string>(), HasSubstr("not observable"));
  EXPECT_THAT(fit["statements"].dump(), HasSubstr("not observable"));
}

TEST(Fit, RefusesWhatCannotBeFitted) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  const auto refusal = [&](const std::function<void(Json&)>& change) {
    Json document = poor_start();
    document["output"]["folder"] = "refused";
    change(document);
    std::string message = message_of([&] { (void)run(document, folder.path); });
    EXPECT_FALSE(fs::exists(folder.path / "refused")) << message;
    return message;
  };
  EXPECT_THAT(refusal([](Json& d) { d.erase("fit"); }), HasSubstr("'fit' is missing"));
  EXPECT_THAT(refusal([](Json& d) { d.erase("captures"); }),
              HasSubstr("captures: a fit needs at least one capture"));
  EXPECT_THAT(refusal([](Json& d) { d["captures"][0]["noise"] = 0; }),
              HasSubstr("captures[0].noise is 0: every sample would count infinitely much"));
  EXPECT_THAT(refusal([](Json& d) {
                d["captures"][0]["holdout"] = {{"capture", true}};
              }),
              HasSubstr("nothing is left to fit to"));
  EXPECT_THAT(refusal([](Json& d) {
                d["captures"][0]["holdout"] = {{"frames", {1, 14}}};
              }),
              HasSubstr("nothing is left to fit to"));
  EXPECT_THAT(refusal([](Json& d) {
                d["captures"][0]["holdout"] = {{"frames", {2, 14}}};
              }),
              HasSubstr("only 1 frame of it is left"));
  EXPECT_THAT(refusal([](Json& d) {
                d["captures"][0]["holdout"] = {{"frames", {0, 4}}};
              }),
              HasSubstr("captures[0].holdout.frames: holds out the first frames"));
  EXPECT_THAT(refusal([](Json& d) {
                d["captures"][0]["transform"] = {{"position", {0, 0, 2}}};
              }),
              HasSubstr("Is it a capture of another body?"));
  EXPECT_THAT(refusal([](Json& d) {
                d["fit"]["parameters"] = {{{"path", "material.E"}, {"bounds", {1e3, 1e4}}}};
              }),
              HasSubstr("fit.parameters[0]: bodies.cube.material.E starts at 150000, outside"));
}

TEST(Fit, StatesWhatIsOddAboutACapture) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  Json document = fit_of(thrown_cube(), {"material.E"});
  // Points off the body, by less than another body's would be.
  document["scene"]["particle_separation"] = 0.025;
  document["captures"][0]["transform"] = {{"position", {0, 0.1, 0}}};
  document["captures"][0]["holdout"] = {{"frames", {40, 50}}};
  document["captures"][0].erase("noise");
  document["fit"]["iterations"] = 1;
  const std::string statements = run(document, folder.path)["fit"]["statements"].dump();
  EXPECT_THAT(statements, HasSubstr("farther than two particle separations"));
  EXPECT_THAT(statements, HasSubstr("no sample lies in the frames [40, 50)"));
  EXPECT_THAT(statements, HasSubstr("its own estimate is"));
}

TEST(Fit, FramesOutOfOrderAndPositionsThatAreNone) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  capture::Arrays arrays = capture::read_npz(folder.path / "a.npz");
  auto times = arrays.at("times").doubles("times");
  auto positions = arrays.at("positions").doubles("positions");
  std::swap(times[3], times[4]);
  arrays["times"] = capture::Array({14}, times);
  capture::write_npz(folder.path / "a.npz", arrays);
  EXPECT_THAT(message_of([&] { (void)run(poor_start(), folder.path); }),
              HasSubstr("Sort the frames by time"));
  // Without marks of visibility NaN means that the point was not seen.
  for (std::size_t k = 0; k < 3; ++k) positions[std::size_t{3} * (5 * 64 + 7) + k] = std::nan("");
  write_tracks(folder.path / "a.npz", positions, 14, 24);
  const Json result = run(poor_start(), folder.path);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.E") / 3e4, 1.0, 0.02);
  EXPECT_THAT(result["notes"].dump(), HasSubstr("of the samples are missing"));
}

/// A fit of little work.
Json short_fit() {
  Json document = fit_of(thrown_cube(), {"material.E"});
  document["scene"]["frames"] = {0, 8};
  document["fit"]["levels"] = {1};
  document["fit"]["windows"] = false;
  document["fit"]["iterations"] = 1;
  return document;
}

TEST(Fit, AProjectThatWasMovedWritesWhereItIs) {
  const Folder folder;
  fs::create_directories(folder.path / "before");
  record(thrown_cube(), folder.path / "before", "a", 1);
  const Json first = run(short_fit(), folder.path / "before");
  fs::rename(folder.path / "before", folder.path / "after");
  write_file(folder.path / "after/out/material_gone.json",
             R"({"schema": "matterfit.material/1", "provenance": {}})");
  write_file(folder.path / "after/out/material_mine.json", "{}");
  const Json again = run(short_fit(), folder.path / "after");
  EXPECT_EQ(bits(again), bits(first));
  EXPECT_EQ(again["folder"], (folder.path / "after/out").string());
  EXPECT_FALSE(fs::exists(folder.path / "before"));
  EXPECT_FALSE(fs::exists(folder.path / "after/out/material_gone.json"));
  EXPECT_TRUE(fs::exists(folder.path / "after/out/material_mine.json"));
}

TEST(Fit, WhatTheDocumentMakesImpossibleIsAnInputError) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  Json document = short_fit();
  document["scene"]["solver"] = {{"memory_limit_gb", 1e-5}};
  try {
    (void)run(document, folder.path);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput) << error.what();
  }
}

TEST(Fit, LabelsSayWhereItIsInAsManyWordsAsFit) {
  fit::SearchProgress report;
  report.stage = "frames 1000-1130";
  report.level = 2.0;
  report.iteration = 12;
  report.rms = 12.34e-3;
  Progress progress;
  label_fit(report, "herschel_bulkley", progress);
  EXPECT_EQ(progress.label,
            "Fitting: herschel_bulkley, frames 1000-1130 ×2, iteration 12, rms 12.34 mm");
  EXPECT_THAT(progress.shorter,
              testing::ElementsAre("Fitting: herschel_bulkley, frames 1000-1130 ×2, rms 12.34 mm",
                                   "Fitting: frames 1000-1130 ×2, rms 12.34 mm"));
  report.iteration = 0;
  label_fit(report, "", progress);
  EXPECT_EQ(progress.label, "Fitting: frames 1000-1130 ×2, rms 12.34 mm");
}

}  // namespace
}  // namespace matterfit::job
