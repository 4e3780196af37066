// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/swaps.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::size_t kSamples = 20;

/// A grid of tracks on a block that tumbles, is struck in the middle and rings, with noise and
/// samples that are not seen.
Tracks tumbling(double noise, double unseen = 0.05) {
  std::mt19937 engine(7);
  std::normal_distribution<double> normal(0.0, noise);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<Vec3d> rest;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) rest.emplace_back(0.03 * i, 0.03 * j, 0.03 * k);
    }
  }
  Tracks tracks;
  tracks.points = rest.size();
  for (std::size_t f = 0; f < kSamples; ++f) {
    const double t = double(f) / 24.0;
    const bool struck = f >= 10;
    tracks.times.push_back(t);
    const double angle = struck ? 4.0 - 9.0 * (t - 10.0 / 24.0) : 4.0 * 24.0 / 10.0 * t;
    const Eigen::AngleAxisd turn(angle, Vec3d(1.0, 2.0, 0.5).normalized());
    for (const Vec3d& x : rest) {
      Vec3d bent = x;
      if (struck) bent.x() += 2.0 * x.z() * x.z() * std::sin(40.0 * t);
      const Vec3d seen = turn * bent + Vec3d(2.0 * t, 0.0, (struck ? 3.0 : -3.0) * t);
      tracks.positions.push_back(seen + Vec3d(normal(engine), normal(engine), normal(engine)));
      tracks.visible.push_back(uniform(engine) < unseen ? 0 : 1);
    }
  }
  return tracks;
}

TEST(Swaps, OfTracksThatKeepTheirPlacesAreNone) {
  EXPECT_THAT(find_swaps(tumbling(5e-4)), IsEmpty());
  EXPECT_THAT(find_swaps(tumbling(0.0)), IsEmpty());
}

TEST(Swaps, AreFoundAndUndone) {
  const Tracks right = tumbling(5e-4, 0.0);
  const std::vector<Swap> made = {{6, 3, 17}, {12, 20, 21}, {15, 3, 17}};
  Tracks wrong = right;
  apply_swaps(made, wrong);
  const std::vector<Swap> found = find_swaps(wrong);
  EXPECT_THAT(found, ElementsAre(made[0], made[1], made[2]));
  apply_swaps(found, wrong);
  for (std::size_t i = 0; i < right.positions.size(); ++i) {
    ASSERT_EQ(right.positions[i], wrong.positions[i]);
  }
}

TEST(Swaps, OfFewTracksAreNotLookedFor) {
  Tracks few;
  few.points = 2;
  for (std::size_t f = 0; f < kSamples; ++f) {
    few.times.push_back(double(f));
    few.positions.emplace_back(f < 5 ? 0.0 : 1.0, 0.0, 0.0);
    few.positions.emplace_back(f < 5 ? 1.0 : 0.0, 0.0, 0.0);
  }
  EXPECT_THAT(find_swaps(few), IsEmpty());
}

TEST(Swaps, RefuseWhatIsNotThere) {
  Tracks tracks = tumbling(0.0);
  EXPECT_THROW(apply_swaps({{kSamples, 0, 1}}, tracks), Error);
  EXPECT_THROW(apply_swaps({{0, 0, tracks.points}}, tracks), Error);
}

}  // namespace
}  // namespace matterfit::capture
