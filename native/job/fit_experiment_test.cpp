// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_experiment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "fit/data/capture_noise.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/run/build_scene.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using testing::HasSubstr;

constexpr std::size_t kExperimentFrames = 14;
constexpr std::size_t kPoints = 64;

/// Tracks of markers() that rest until `release` and then fly; point i is seen in the frames that
/// `seen` names.
void write_flight(const fs::path& folder, std::size_t release,
                  const std::function<bool(std::size_t t, std::size_t i)>& seen,
                  const std::vector<double>& noise = {}) {
  std::vector<double> positions;
  std::vector<double> times;
  for (std::size_t t = 0; t < kExperimentFrames; ++t) {
    times.push_back(double(t) / 24.0);
    const double flown = t > release ? double(t - release) / 24.0 : 0.0;
    for (std::size_t i = 0; i < kPoints; ++i) {
      const Vec3d x = markers()[i] + flown * Vec3d(0.8, 0.3, 1.5);
      for (int k = 0; k < 3; ++k) positions.push_back(seen(t, i) ? x[k] : std::nan(""));
    }
  }
  capture::Arrays arrays;
  arrays["positions"] = capture::Array({kExperimentFrames, kPoints, 3}, positions);
  arrays["times"] = capture::Array({kExperimentFrames}, times);
  if (!noise.empty()) arrays["noise"] = capture::Array({kPoints}, noise);
  capture::write_npz(folder / "a.npz", arrays);
}

struct Loaded {
  fit::Run run;
  std::string statements;
};

Loaded loaded(const fs::path& folder, const std::function<void(Json&)>& change = {}) {
  Json document = fit_of(thrown_cube(), {"material.E"});
  if (change) change(document);
  const Job job = job_of(document, folder);
  std::vector<std::string> statements;
  Loaded result;
  result.run = load_experiment(job, statements).experiment.runs.front();
  Arena arena(1);
  fit::settle_noise(result.run.captures, build_scene(job, arena, Interrupter()).scene, statements);
  result.statements = Json(statements).dump();
  return result;
}

bool is_used(const fit::Capture& capture, std::size_t point) {
  for (std::size_t t = 0; t < kExperimentFrames; ++t) {
    if (capture.used[t * kPoints + point] != 0) return true;
  }
  return false;
}

TEST(FitCaptures, APointThatIsSeenFirstInFlightIsLeftOut) {
  const Folder folder;
  const auto late = [](std::size_t t, std::size_t i) { return i != 7 || t >= 5; };
  write_flight(folder.path, 0, late);
  const Loaded left = loaded(folder.path);
  EXPECT_FALSE(left.run.captures[0].input.rest[7].allFinite());
  EXPECT_FALSE(is_used(left.run.captures[0], 7));
  EXPECT_TRUE(is_used(left.run.captures[0], 8));
  EXPECT_THAT(left.statements, HasSubstr("captures.a: 1 of its 64 points (7) are seen first when"));
  // It is used where the document says where it belongs, or while the body rests.
  const Loaded placed = loaded(folder.path, [](Json& d) {
    for (const Vec3d& x : markers()) {
      d["captures"][0]["positions"].push_back({x.x(), x.y(), x.z()});
    }
  });
  EXPECT_TRUE(is_used(placed.run.captures[0], 7));
  EXPECT_EQ(placed.statements, "[]");
  write_flight(folder.path, 6, late);
  const Loaded resting = loaded(folder.path);
  EXPECT_TRUE(is_used(resting.run.captures[0], 7));
  EXPECT_EQ(resting.run.captures[0].input.rest[7], markers()[7]);
  EXPECT_EQ(resting.statements, "[]");
}

TEST(FitCaptures, APointWhoseRestIsHeldOutIsHeldOut) {
  const Folder folder;
  const auto hold = [](Json& d) { d["captures"][0]["holdout"] = {{"frames", {10, 14}}}; };
  write_flight(folder.path, 0, [](std::size_t t, std::size_t i) { return i != 7 || t >= 11; });
  const Loaded tail = loaded(folder.path, hold);
  EXPECT_FALSE(is_used(tail.run.captures[0], 7));
  EXPECT_EQ(tail.run.captures[0].used_count, 63U * 9);
  // At rest in held-out frames only.
  write_flight(folder.path, 4, [](std::size_t t, std::size_t i) { return i != 7 || t >= 3; });
  const Loaded quiet = loaded(folder.path, [](Json& d) {
    d["captures"][0]["release"] = 4;
    d["captures"][0]["holdout"] = {{"frames", {3, 5}}};
  });
  EXPECT_FALSE(is_used(quiet.run.captures[0], 7));
  EXPECT_EQ(quiet.run.captures[0].input.held_out_points[7], 1);
  EXPECT_THAT(quiet.statements, HasSubstr("points (7) are seen at rest in held-out frames only"));
}

TEST(FitCaptures, WhatSaysNothingIsNeitherUsedNorPredicted) {
  const Folder folder;
  write_flight(folder.path, 4, [](std::size_t, std::size_t) { return true; });
  const Loaded found = loaded(folder.path, [](Json& d) {
    d["captures"][0]["release"] = 4;
    d["captures"][0]["holdout"] = {{"frames", {10, 14}}, {"tracks", {3}}};
  });
  const fit::Capture& capture = found.run.captures[0];
  for (std::size_t t = 0; t < kExperimentFrames; ++t) {
    EXPECT_EQ(capture.used[t * kPoints], t > 4 && t < 10 ? 1 : 0) << t;
    EXPECT_EQ(capture.predicted[t * kPoints], t >= 10 ? 1 : 0) << t;
    EXPECT_EQ(capture.predicted[t * kPoints + 3], t > 4 ? 1 : 0) << t;
  }
}

TEST(FitCaptures, AHoldOutThatPredictsNothingIsTold) {
  const Folder folder;
  write_flight(folder.path, 4, [](std::size_t, std::size_t) { return true; });
  const Loaded found = loaded(folder.path, [](Json& d) {
    d["captures"][0]["release"] = 4;
    d["captures"][0]["holdout"] = {{"frames", {0, 2}}};
  });
  EXPECT_THAT(found.statements, HasSubstr("in the frames [0, 2) can be predicted"));
}

TEST(FitCaptures, ACloudOfSinglePointsIsRefused) {
  const Folder folder;
  write_flight(folder.path, 0, [](std::size_t, std::size_t i) { return i == 3; });
  EXPECT_THAT([&] { (void)loaded(folder.path, [](Json& d) { d["fit"]["loss"] = "chamfer"; }); },
              testing::ThrowsMessage<Error>(HasSubstr("one point each, which is no cloud")));
}

TEST(FitCaptures, OnlyNoiseThatIsZeroIsEstimated) {
  const Folder folder;
  std::vector<double> noise(kPoints, 2e-3);
  noise[5] = 0.0;
  write_flight(
      folder.path, 0, [](std::size_t, std::size_t) { return true; }, noise);
  const Loaded found = loaded(folder.path, [](Json& d) { d["captures"][0].erase("noise"); });
  EXPECT_EQ(found.run.captures[0].sigma[4], 2e-3);
  EXPECT_GT(found.run.captures[0].sigma[5], 0.0);
  EXPECT_NE(found.run.captures[0].sigma[5], 2e-3);
  EXPECT_THAT(found.statements,
              HasSubstr("captures.a: the noise of 1 of its 64 points (5) is given as 0"));
}

TEST(FitCaptures, PlacesFromNoisyFramesAddTheirNoise) {
  const auto deviation = [](const std::function<void(Json&)>& change) {
    const Folder folder;
    write_flight(
        folder.path, 0, [](std::size_t, std::size_t) { return true; },
        std::vector<double>(kPoints, 2e-3));
    return loaded(folder.path, change).run.captures[0].deviation(3) / 2e-3;
  };
  const auto own = [](Json& d) { d["captures"][0].erase("noise"); };
  EXPECT_DOUBLE_EQ(deviation(own), std::sqrt(2.0));
  // The mean of the frames 0 to 4.
  EXPECT_DOUBLE_EQ(deviation([&](Json& d) {
                     own(d);
                     d["captures"][0]["release"] = 4;
                   }),
                   std::sqrt(1.2));
  EXPECT_DOUBLE_EQ(deviation([&](Json& d) {
                     own(d);
                     d["captures"][0]["positions"] = Json::array();
                     for (std::size_t i = 0; i < kPoints; ++i) {
                       d["captures"][0]["positions"].push_back({0.1, 0.1, 0.2});
                     }
                   }),
                   1.0);
}

TEST(FitCaptures, NoiseOfCloudsIsNotEstimatedOverTime) {
  const Folder folder;
  write_flight(folder.path, 0, [](std::size_t t, std::size_t i) { return i != 7 || t >= 5; });
  const Loaded found = loaded(folder.path, [](Json& d) {
    d["captures"][0].erase("noise");
    d["fit"]["loss"] = "chamfer";
  });
  EXPECT_NEAR(found.run.captures[0].sigma[0], 1e-3 * kSize, 0.2e-3 * kSize);
  EXPECT_THAT(found.statements, HasSubstr("without correspondence it cannot be estimated"));
  EXPECT_TRUE(is_used(found.run.captures[0], 7)) << "a cloud's points have no rest of their own";
}

}  // namespace
}  // namespace matterfit::job
