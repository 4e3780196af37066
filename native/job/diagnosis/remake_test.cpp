// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/remake.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <string>

#include "shape/collider.hpp"

namespace matterfit::job {
namespace {

/// A cube of 20 cm that is thrown along x, half a metre above a ground at 0.1 m.
mpm::Scene thrown_over_ground() {
  mpm::Scene scene;
  scene.fps = 50.0;
  scene.first_frame = 3;
  scene.end_frame = 14;
  mpm::Body& body = scene.bodies.emplace_back();
  body.velocity = Vec3d(2.0, 0.0, 0.0);
  for (int i = 0; i < 8; ++i) {
    body.rest.push_back(0.2 * Vec3d(i & 1, (i >> 1) & 1, i >> 2) + Vec3d(0.0, 0.0, 0.6));
    body.volumes.push_back(1e-3);
  }
  scene.colliders.push_back(shape::make_plane("ground", {}, Vec3d(0.0, 0.0, 0.1), Vec3d::UnitZ()));
  return scene;
}

std::optional<Remake> named(const std::string& name, const mpm::Scene& scene) {
  for (const Remake& other : remakes_of(scene, 0, {"ground"})) {
    if (other.name == name) return other;
  }
  return std::nullopt;
}

TEST(Remake, AFlyingBodyIsThrownOtherwise) {
  mpm::Scene scene = thrown_over_ground();
  const auto sideways = named("sideways", scene);
  ASSERT_TRUE(sideways);
  remake(*sideways, 0, scene);
  EXPECT_DOUBLE_EQ(scene.bodies[0].velocity.x(), 2.0);
  EXPECT_GT(scene.bodies[0].velocity.y(), 1.0);
  EXPECT_EQ(scene.end_frame, 14);
}

TEST(Remake, FromHigherTheGroundLiesLower) {
  mpm::Scene scene = thrown_over_ground();
  const auto higher = named("higher", scene);
  ASSERT_TRUE(higher);
  remake(*higher, 0, scene);
  const shape::SurfacePoint below = scene.colliders[0]->closest(Vec3d::Zero(), 0.0);
  EXPECT_NEAR(below.distance, higher->higher - 0.1, 1e-12);
  EXPECT_NEAR(below.normal.z(), 1.0, 1e-12);
}

TEST(Remake, AWallIsNotLowered) {
  mpm::Scene scene = thrown_over_ground();
  scene.colliders.push_back(shape::make_plane("wall", {}, Vec3d::UnitX(), -Vec3d::UnitX()));
  EXPECT_FALSE(named("higher", scene));
}

TEST(Remake, LongerIsTwiceTheFrames) {
  mpm::Scene scene = thrown_over_ground();
  const auto longer = named("longer", scene);
  ASSERT_TRUE(longer);
  remake(*longer, 0, scene);
  EXPECT_EQ(scene.end_frame, 24);
}

TEST(Remake, WhatIsHeldIsTurnedAndNotThrown) {
  mpm::Scene scene = thrown_over_ground();
  scene.colliders.clear();
  scene.bodies[0].pins.emplace_back();
  EXPECT_FALSE(named("sideways", scene));
  const auto turned = named("turned", scene);
  ASSERT_TRUE(turned);
  remake(*turned, 0, scene);
  EXPECT_NEAR(scene.gravity.at(0.0).z(), 0.0, 1e-12);
  EXPECT_NEAR(scene.gravity.at(0.0).norm(), 9.81, 1e-12);
}

}  // namespace
}  // namespace matterfit::job
