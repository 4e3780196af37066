// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/hidden_collider.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "job/diagnosis/flight_for_test.hpp"

namespace matterfit::job {
namespace {

using Eigen::Index;

constexpr Index kFrames = 30;
constexpr Index kTracks = 8;
constexpr double kInterval = 1.0 / 60.0;
constexpr double kSpeed = 3.0;  // [m/s]
const Vec3d kGravity(0.0, 0.0, -9.81);

/// A cube that flies along x; from `turn` on backwards.
diagnose::Capture flight(Index turn, double speed_after) {
  return flight_of_a_cube(kFrames, kInterval, [&](Index f, double t) -> Vec3d {
    const double met = double(std::min(f, turn)) * kInterval;
    return Vec3d(kSpeed * met + speed_after * (t - met), 0.0, 0.0) + 0.5 * t * t * kGravity;
  });
}

TEST(Encounters, AreWhereARecordingTurnsAndTheSimulationPasses) {
  const diagnose::Capture seen = flight(12, -1.5);
  const diagnose::Capture simulated = flight(kFrames, kSpeed);
  const auto found = encounters({seen}, simulated.positions, kGravity);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR((found[0].normal - Vec3d(-1.0, 0.0, 0.0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR(found[0].point.x(), 0.2 + kSpeed * 12 * kInterval, 1e-9);
  EXPECT_NEAR(found[0].time, 11 * kInterval, 1e-9);
  EXPECT_NEAR(found[0].reach, kSpeed * double(kFrames - 1 - 12) * kInterval, 1e-9);
}

TEST(Encounters, WhatWasHeldOutShowsNone) {
  diagnose::Capture seen = flight(24, -1.5);
  for (Index s = 20 * kTracks; s < kFrames * kTracks; ++s) {
    seen.use[std::size_t(s)] = diagnose::Use::kHeldOut;
  }
  EXPECT_TRUE(encounters({seen}, flight(kFrames, kSpeed).positions, kGravity).empty());
}

/// A contact of the simulation that is a little off is not another collider.
TEST(Encounters, OnesOwnContactIsNone) {
  EXPECT_TRUE(encounters({flight(12, -1.5)}, flight(12, -1.2).positions, kGravity).empty());
}

TEST(HiddenCollider, IsWrittenAsItActs) {
  Encounter met;
  met.point = Vec3d(1.0, 0.2, 0.3);
  met.normal = Vec3d(-1.0, 0.0, 0.0);
  met.time = 0.2;
  mpm::Scene scene;
  mpm::Body& body = scene.bodies.emplace_back();
  body.rest = {Vec3d(0.0, 0.0, 0.0), Vec3d(0.2, 0.2, 0.2)};
  body.volumes = {1e-3, 1e-3};
  const std::optional<Cause> cause = hidden_collider({met}, scene);
  ASSERT_TRUE(cause);
  const std::vector<diagnose::Number>& numbers = cause->row.numbers;
  ASSERT_EQ(numbers.size(), 4U);
  // Where it was seen, tilted by .1, without friction.
  const std::vector<double> values{numbers[0].first_step, 0.06, 0.08, 0.0};
  cause->apply(values, 0, scene);
  ASSERT_EQ(scene.colliders.size(), 1U);
  EXPECT_EQ(scene.colliders[0]->contact().mu, 0.0);
  Json document = {{"colliders", Json::array()}};
  cause->write(values, 0, document);
  const Json& written = document["colliders"][0];
  Vec3d normal;
  for (int a = 0; a < 3; ++a) normal[a] = written["normal"][std::size_t(a)].get<double>();
  EXPECT_NEAR(normal.norm(), 1.0, 1e-12);
  EXPECT_NEAR(std::acos(normal.dot(met.normal)), 0.1, 1e-9);
  for (int a = 0; a < 3; ++a) {
    EXPECT_NEAR(written["point"][std::size_t(a)].get<double>(), met.point[a], 1e-12);
  }
  const std::vector<double> nothing(4, 0.0);
  scene.colliders.clear();
  cause->apply(nothing, 0, scene);
  EXPECT_TRUE(scene.colliders.empty());
}

}  // namespace
}  // namespace matterfit::job
