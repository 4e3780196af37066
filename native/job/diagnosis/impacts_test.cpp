// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/impacts.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "shape/collider.hpp"

namespace matterfit::job {
namespace {

using Eigen::Index;

constexpr Index kSeenFrames = 28;
constexpr Index kCorners = 8;
constexpr double kSeenFps = 60.0;
constexpr int kFirst = 5;

/// A cube of 20 cm over a floor at 0.
mpm::Scene floor_scene() {
  mpm::Scene scene;
  scene.fps = kSeenFps;
  scene.first_frame = kFirst;
  scene.end_frame = kFirst + int(kSeenFrames);
  mpm::Body& body = scene.bodies.emplace_back();
  for (int i = 0; i < 8; ++i) {
    body.rest.push_back(0.2 * Vec3d(i & 1, (i >> 1) & 1, i >> 2));
    body.volumes.push_back(1e-3);
  }
  scene.colliders.push_back(shape::make_plane("ground", {}, Vec3d::Zero(), Vec3d::UnitZ()));
  return scene;
}

/// The corners of the cube, dropped from `height` with a speed across; each bounce keeps half of
/// the speed. They tremble by 1 mm from frame to
/// frame, and have noise.
diagnose::Capture bouncing(double height) {
  diagnose::Capture capture;
  capture.positions.resize(3 * kSeenFrames * kCorners);
  capture.use.assign(std::size_t(kSeenFrames * kCorners), diagnose::Use::kUsed);
  capture.noise = 5e-4;
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, capture.noise);
  for (Index i = 0; i < kCorners; ++i) {
    capture.rest.push_back(0.2 * Vec3d(double(i & 1), double((i >> 1) & 1), double(i >> 2)));
  }
  double z = height;
  double speed = 0.0;
  constexpr int kSteps = 100;
  for (Index f = 0; f < kSeenFrames; ++f) {
    for (int s = 0; s < kSteps && f > 0; ++s) {
      const double dt = 1.0 / (kSeenFps * kSteps);
      speed -= 9.81 * dt;
      z += dt * speed;
      if (z < 0.0 && speed < 0.0) speed *= -0.5;
    }
    const double t = double(f) / kSeenFps;
    const double tremble = f % 2 == 0 ? 1e-3 : -1e-3;
    capture.times.push_back(t);
    for (Index i = 0; i < kCorners; ++i) {
      Vec3d error;
      for (int a = 0; a < 3; ++a) error[a] = noise(random);
      capture.positions.segment<3>(3 * (f * kCorners + i)) =
          capture.rest[std::size_t(i)] + Vec3d(0.5 * t + tremble, 0.0, z) + error;
    }
  }
  return capture;
}

TEST(Impacts, EndWhereABodyLeavesTheFloor) {
  const std::vector<Impact> found = impacts(bouncing(0.2), floor_scene(), 2, 0);
  ASSERT_EQ(found.size(), 2U);
  // After √(2 · .2 / 9.81) = .202 s it falls at 1.98 m/s and leaves at .99; again .202 s later.
  EXPECT_NEAR(found[0].frame - kFirst, 12.0, 2.0);
  EXPECT_NEAR(found[1].frame - kFirst, 24.0, 2.0);
  EXPECT_NEAR(found[0].speed, 0.015 * 2.97, 0.006);
  EXPECT_NEAR(found[1].speed, 0.015 * 1.49, 0.006);
  EXPECT_EQ(found[0].run, 2U);
}

TEST(Impacts, AFlightHasNone) {
  EXPECT_TRUE(impacts(bouncing(5.0), floor_scene(), 0, 0).empty());
  mpm::Scene air = floor_scene();
  air.colliders.clear();
  EXPECT_TRUE(impacts(bouncing(0.2), air, 0, 0).empty());
}

TEST(Impacts, WhatWasHeldOutShowsThemToo) {
  diagnose::Capture capture = bouncing(0.2);
  for (Index s = 10 * kCorners; s < kSeenFrames * kCorners; ++s) {
    capture.use[std::size_t(s)] = diagnose::Use::kHeldOut;
  }
  EXPECT_EQ(impacts(capture, floor_scene(), 0, 0).size(), 2U);
  for (diagnose::Use& use : capture.use) {
    if (use == diagnose::Use::kHeldOut) use = diagnose::Use::kIgnored;
  }
  EXPECT_TRUE(impacts(capture, floor_scene(), 0, 0).empty());
}

}  // namespace
}  // namespace matterfit::job
