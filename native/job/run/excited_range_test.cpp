// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/excited_range.hpp"

#include <gmock/gmock.h>

#include <cmath>

namespace matterfit::job {
namespace {

SceneDoc seen_at(const std::optional<material::Excitation>& excited) {
  SceneDoc scene;
  scene.fps = 10.0;
  scene.bodies.resize(1);
  scene.bodies[0].name = "cube";
  scene.bodies[0].excited = excited;
  return scene;
}

/// Twenty particles, all stretched alike without a change of volume, one much more.
mpm::FrameState stretched(int frame, double by) {
  mpm::FrameState state;
  state.frame = frame;
  state.bodies.resize(1);
  const auto f = [](double x) {
    return Mat3f(
        Vec3f(float(x), float(1.0 / std::sqrt(x)), float(1.0 / std::sqrt(x))).asDiagonal());
  };
  state.bodies[0].deformation_gradients.assign(20, f(by));
  state.bodies[0].deformation_gradients[0] = f(5.0);
  return state;
}

const material::Excitation kSeen{0.2, 0.05, 0.05, 0.5, 2.0};

TEST(ExcitedRange, ARunWithinItHasNothingToSay) {
  ExcitedRange range(seen_at(kSeen));
  EXPECT_TRUE(range.any());
  // |dev ε| = √(3/2) ln 1.15 = .17, by .17 in a tenth of a second.
  range.record(stretched(0, 1.0));
  range.record(stretched(1, 1.15));
  EXPECT_TRUE(range.notes().empty());
  EXPECT_FALSE(ExcitedRange(seen_at({})).any());
}

TEST(ExcitedRange, WhatAFitHasSeenEndsWithItsFrames) {
  ExcitedRange range(seen_at({}), true);
  range.record(stretched(0, 1.0));
  range.record(stretched(1, 1.15));
  range.record(stretched(2, 1.5));
  const auto found = range.seen("cube", 1.0);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->strain, std::sqrt(1.5) * std::log(1.15), 1e-6);
  EXPECT_NEAR(range.seen("cube", 2.0)->strain, std::sqrt(1.5) * std::log(1.5), 1e-6);
  EXPECT_FALSE(range.seen("other", 2.0));
  EXPECT_TRUE(range.notes().empty());
  // The same run again stays within what it was seen at.
  ExcitedRange again(seen_at(found));
  again.record(stretched(0, 1.0));
  again.record(stretched(1, 1.15));
  EXPECT_TRUE(again.notes().empty());
}

TEST(ExcitedRange, ALargerStrainAndAFasterOneAreSaidWithTheirFrame) {
  ExcitedRange range(seen_at(kSeen));
  range.record(stretched(0, 1.0));
  range.record(stretched(1, 1.15));
  range.record(stretched(2, 1.5));
  range.record(stretched(3, 1.4));
  const auto notes = range.notes();
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0], testing::HasSubstr("'cube' leaves"));
  EXPECT_THAT(notes[0], testing::HasSubstr("a strain of 0.5 at frame 2 (seen: 0.2)"));
  EXPECT_THAT(notes[0], testing::HasSubstr("a rate of"));
  EXPECT_THAT(notes[0], testing::Not(testing::HasSubstr("volume")));
}

TEST(ExcitedRange, WhatFlowsCountsWithItsPlasticStrain) {
  ExcitedRange range(seen_at(kSeen));
  mpm::FrameState state = stretched(4, 1.0);
  state.bodies[0].plastic_strain.assign(20, 0.3F);
  range.record(state);
  const auto notes = range.notes();
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0], testing::HasSubstr("a strain of 0.37 at frame 4"));
}

TEST(ExcitedRange, AChangeOfVolumeIsSaidEitherWay) {
  ExcitedRange range(seen_at(kSeen));
  mpm::FrameState state = stretched(1, 1.0);
  for (Mat3f& f : state.bodies[0].deformation_gradients) f = 0.95F * Mat3f::Identity();
  range.record(state);
  const auto notes = range.notes();
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0], testing::HasSubstr("a loss of volume of 0.15 at frame 1 (seen: 0.05)"));
}

}  // namespace
}  // namespace matterfit::job
