// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/penetration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace matterfit::job {
namespace {

using testing::HasSubstr;

TEST(Penetration, NamesTheDeepest) {
  mpm::Scene scene;
  scene.bodies.resize(2);
  scene.bodies[0].name = "high";
  scene.bodies[1].name = "low";
  scene.colliders = {
      shape::make_plane("ground", {}, Vec3d::Zero(), Vec3d::UnitZ()),
      shape::make_plane("my ramp", {.stiffness = 4e6}, Vec3d(0, 0, 0.1), Vec3d::UnitZ())};
  mpm::FrameState state;
  state.bodies.resize(2);
  state.bodies[0].positions = {Vec3f(0, 0, 1)};
  EXPECT_EQ(deepest(scene, state).depth, 0.0);
  state.bodies[1].positions = {Vec3f(0, 0, 0.5F), Vec3f(0, 0, -0.16F)};
  const Penetration found = deepest(scene, state);
  EXPECT_NEAR(found.depth, 0.26, 1e-6);
  EXPECT_EQ(penetration_note(found),
            "'low' sank 26 cm into 'my ramp'. Raise scene.colliders.\"my ramp\".contact.stiffness "
            "(now 4e+06 Pa/m) if it should not.");
}

}  // namespace
}  // namespace matterfit::job
