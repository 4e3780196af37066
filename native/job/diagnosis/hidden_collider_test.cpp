// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/hidden_collider.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace matterfit::job {
namespace {

using Eigen::Index;

constexpr Index kFrames = 30;
constexpr Index kTracks = 8;
constexpr double kInterval = 1.0 / 60.0;
constexpr double kSpeed = 3.0;  // [m/s]
const Vec3d kGravity(0.0, 0.0, -9.81);

/// The corners of a cube of 20 cm that flies along x; from `turn` on backwards.
diagnose::Capture flight(Index turn, double speed_after) {
  diagnose::Capture capture;
  capture.name = "a";
  capture.positions.resize(3 * kFrames * kTracks);
  capture.use.assign(std::size_t(kFrames * kTracks), diagnose::Use::kUsed);
  for (Index i = 0; i < kTracks; ++i) {
    capture.rest.push_back(0.2 * Vec3d(double(i & 1), double((i >> 1) & 1), double(i >> 2)));
  }
  for (Index f = 0; f < kFrames; ++f) {
    const double t = double(f) * kInterval;
    const double met = double(std::min(f, turn)) * kInterval;
    const Vec3d moved =
        Vec3d(kSpeed * met + speed_after * (t - met), 0.0, 0.0) + 0.5 * t * t * kGravity;
    capture.times.push_back(t);
    for (Index i = 0; i < kTracks; ++i) {
      capture.positions.segment<3>(3 * (f * kTracks + i)) = capture.rest[std::size_t(i)] + moved;
    }
  }
  return capture;
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

}  // namespace
}  // namespace matterfit::job
