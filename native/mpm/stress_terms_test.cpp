// SPDX-License-Identifier: GPL-3.0-or-later
// Effects that have a stress, or that take speed away fast: motions with a known answer, and what
// they do to the substep.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "base/error.hpp"
#include "mpm/scene_check.hpp"
#include "mpm/simulation.hpp"
#include "mpm/step_limit.hpp"
#include "mpm/terms_for_test.hpp"

namespace matterfit::mpm {
namespace {

using effects::Effect;
using effects::make_effect;

class StressTerms : public ::testing::TestWithParam<Formulation> {};

INSTANTIATE_TEST_SUITE_P(Formulations, StressTerms,
                         ::testing::Values(Formulation::kTotal, Formulation::kUpdated,
                                           Formulation::kRenewed),
                         [](const auto& info) {
                           switch (info.param) {
                             case Formulation::kTotal:
                               return "total";
                             case Formulation::kUpdated:
                               return "updated";
                             default:
                               return "renewed";
                           }
                         });

/// A ball that turns so fast about z that it widens.
Scene spinning(Formulation formulation) {
  Scene scene = ball(formulation, Vec3d::Zero());
  scene.end_frame = 4;
  scene.fps = 500.0;
  scene.bodies[0].spin = Vec3d(0.0, 0.0, 200.0);
  return scene;
}

/// Largest distance from the axis z [m].
double width(const Scene& scene) {
  const FrameState end = last_state(scene);
  double most = 0.0;
  for (const Vec3f& x : end.bodies[0].positions) {
    most = std::max(most, static_cast<double>(x.head<2>().norm()));
  }
  return most;
}

double first_dt(const Scene& scene) {
  Simulation simulation(scene, std::make_shared<Arena>(1), {});
  return simulation.advance(Interrupter()).dt;
}

TEST_P(StressTerms, AnInclusionAroundTheWholeBodyIsAStifferBody) {
  const Scene soft = spinning(GetParam());
  Scene stiff = soft;
  stiff.bodies[0].material.youngs_modulus *= 2.0;
  Scene reinforced = soft;
  Effect inclusion = make_effect("stiffness_inclusion");
  set(inclusion, "radius", 100.0);
  set(inclusion, "modulus", 1e5);
  set(inclusion, "nu", 0.3);
  reinforced.effects = {inclusion};
  const double soft_width = width(soft);
  const double stiff_width = width(stiff);
  ASSERT_GT(soft_width - stiff_width, 1e-3);
  EXPECT_NEAR(width(reinforced), stiff_width, 0.17 * (soft_width - stiff_width));
  // And a softer one is a softer body.
  set(inclusion, "modulus", -1e5);
  stiff.effects = {inclusion};
  EXPECT_NEAR(width(stiff), soft_width, 0.17 * (soft_width - stiff_width));
}

/// How far the ends of the body along an axis at rest are apart in the end [m].
double length(const Scene& scene, int axis) {
  const Points& rest = scene.bodies[0].rest;
  std::size_t low = 0;
  std::size_t high = 0;
  const auto along = [&](std::size_t p, double sign) {
    Vec3d off = rest[p];
    off[axis] = 0.0;
    return sign * rest[p][axis] - off.norm();
  };
  for (std::size_t p = 0; p < rest.size(); ++p) {
    if (along(p, 1.0) > along(high, 1.0)) high = p;
    if (along(p, -1.0) > along(low, -1.0)) low = p;
  }
  const std::vector<Vec3f> end = last_state(scene).bodies[0].positions;
  return static_cast<double>((end[high] - end[low]).norm());
}

TEST_P(StressTerms, FibresHoldAlongThemselvesAlone) {
  const Scene plain = spinning(GetParam());
  Scene held = plain;
  Effect fibres = make_effect("fibres");
  set(fibres, "direction", Vec3d(2.0, 0.0, 0.0));
  set(fibres, "modulus", 3e5);
  held.effects = {fibres};
  const double shorter = length(plain, 0) - length(held, 0);
  ASSERT_GT(shorter, 1e-3);
  // Across them it is as free as before, and thins less.
  EXPECT_GT(length(held, 1) - length(plain, 1), -0.2 * shorter);
}

TEST_P(StressTerms, WhatStiffensShortensTheSubstep) {
  const Scene soft = spinning(GetParam());
  Scene stiff = soft;
  stiff.fps = 50.0;
  Scene plain = stiff;
  Effect inclusion = make_effect("stiffness_inclusion");
  set(inclusion, "radius", 100.0);
  set(inclusion, "modulus", 3e5);
  stiff.effects = {inclusion};
  plain.bodies[0].spin.setZero();
  stiff.bodies[0].spin.setZero();
  // Four times the modulus: half the substep, up to whole ones a frame.
  EXPECT_NEAR(first_dt(plain) / first_dt(stiff), 2.0, 0.3);
  EXPECT_NEAR(step_limit(plain) / step_limit(stiff), 2.0, 0.1);
}

TEST_P(StressTerms, AStrongDragStopsAndDoesNotTurnAround) {
  Scene scene = ball(GetParam(), Vec3d(2.0, 0.0, 0.0));
  scene.end_frame = 3;
  // So soft that its own limit is four times as long as the drag allows.
  scene.bodies[0].material.youngs_modulus = 1e3;
  Effect drag = make_effect("drag_linear");
  set(drag, "rate", 900.0);
  scene.effects = {drag};
  const BodyState end = last_state(scene).bodies[0];
  double low = 1e9;
  double high = -1e9;
  double way = 0.0;
  for (std::size_t p = 0; p < end.positions.size(); ++p) {
    low = std::min(low, static_cast<double>(end.velocities[p].x()));
    high = std::max(high, static_cast<double>(end.velocities[p].x()));
    way += (static_cast<double>(end.positions[p].x()) - scene.bodies[0].rest[p].x()) /
           static_cast<double>(end.positions.size());
  }
  // From 2 m/s; nodes whose mass was raised feel less of the drag and follow by their ties.
  EXPECT_GT(low, -3e-3);
  EXPECT_LT(high, 3e-3);
  EXPECT_NEAR(way, 2.0 / 900.0, 1.5e-3);
  // Where the scene gives the substep it is refused.
  scene.dt = 2e-3;
  EXPECT_THAT([&] { (void)last_state(scene); },
              ::testing::ThrowsMessage<Error>(::testing::HasSubstr("the drag on body 'ball'")));
}

}  // namespace
}  // namespace matterfit::mpm
