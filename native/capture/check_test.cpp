// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <random>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

/// Points that fall and bounce (restitution 0.7), with noise.
Tracks bouncing(double sigma, std::size_t frames = 200, std::size_t points = 5) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, 1.0);
  Tracks tracks;
  tracks.points = points;
  double z = 0.5;
  double v = 0.0;
  const double dt = 0.01;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    tracks.times.push_back(static_cast<double>(frame) * dt);
    for (std::size_t p = 0; p < points; ++p) {
      tracks.positions.emplace_back(
          Vec3d(static_cast<double>(p) * 0.1, 0.02 * static_cast<double>(frame) * dt, z) +
          sigma * Vec3d(normal(random), normal(random), normal(random)));
    }
    for (int k = 0; k < 100; ++k) {
      v -= 9.81 * dt / 100;
      z += v * dt / 100;
      if (z < 0.0 && v < 0.0) v = -0.7 * v;
    }
  }
  return tracks;
}

std::string joined(const CaptureSummary& summary) {
  std::string text;
  for (const std::string& line : summary.text) text += line + "\n";
  return text;
}

TEST(CheckTest, CleanCapture) {
  const double sigma = 3e-4;
  const CaptureSummary summary = summarise(bouncing(sigma));
  EXPECT_EQ(summary.frames, 200U);
  EXPECT_EQ(summary.points, 5U);
  EXPECT_NEAR(summary.spacing, 0.01, 1e-12);
  EXPECT_EQ(summary.irregular, 0U);
  EXPECT_TRUE(summary.gaps.empty());
  EXPECT_EQ(summary.jump_count, 0U) << joined(summary);
  EXPECT_EQ(summary.missing, 0.0);
  EXPECT_TRUE(summary.unit_warning.empty());
  EXPECT_NEAR(summary.noise, sigma, 0.1 * sigma) << "third differences do not see the free fall";
  for (const double noise : summary.point_noise) EXPECT_NEAR(noise, sigma, 0.3 * sigma);
  EXPECT_THAT(joined(summary), AllOf(HasSubstr("200 frames of 5 points over 1.99 s"),
                                     HasSubstr("A frame every 10 ms (100 Hz), regular"),
                                     HasSubstr("No jumps"), Not(HasSubstr("Warning"))));
}

// Without noise, bounces and the start of motion must not count as jumps either.
TEST(CheckTest, BouncesAreNoJumps) {
  for (const double sigma : {0.0, 1e-6, 1e-5, 1e-4}) {
    EXPECT_EQ(summarise(bouncing(sigma)).jump_count, 0U) << sigma;
  }
}

TEST(CheckTest, JumpsAreNamedByPointFrameAndSize) {
  Tracks tracks = bouncing(1e-4);
  tracks.positions[50 * 5 + 2] += Vec3d(0.2, 0, 0);  // One frame out and back.
  for (std::size_t frame = 120; frame < 200; ++frame) {
    tracks.positions[frame * 5 + 4] += Vec3d(0, 0.1, 0);  // A marker that was taken for another.
  }
  tracks.labels = {"a", "b", "c", "d", "e"};
  const CaptureSummary summary = summarise(tracks);
  ASSERT_EQ(summary.jump_count, 2U) << joined(summary);
  EXPECT_EQ(summary.jumps[0].point, 2U);
  EXPECT_EQ(summary.jumps[0].frame, 50U);
  EXPECT_NEAR(summary.jumps[0].size, 0.2, 0.02);
  EXPECT_EQ(summary.jumps[1].point, 4U);
  EXPECT_EQ(summary.jumps[1].frame, 120U);
  EXPECT_NEAR(summary.jumps[1].size, 0.1, 0.02);
  EXPECT_THAT(joined(summary), HasSubstr("2 jumps, the largest 200 mm: point 2 (c) at frame 50"));
}

TEST(CheckTest, GapsIrregularTimesAndMissingSamples) {
  Tracks tracks = bouncing(1e-4);
  for (std::size_t frame = 60; frame < 200; ++frame) tracks.times[frame] += 0.5;
  tracks.times[10] += 0.003;
  tracks.visible.assign(tracks.positions.size(), 1);
  for (std::size_t frame = 0; frame < 200; ++frame) {
    tracks.visible[frame * 5 + 1] = 0;
    tracks.positions[frame * 5 + 1].setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  const CaptureSummary summary = summarise(tracks);
  EXPECT_EQ(summary.irregular, 3U);
  ASSERT_EQ(summary.gaps.size(), 1U);
  EXPECT_EQ(summary.gaps[0].frame, 60U);
  EXPECT_NEAR(summary.gaps[0].seconds, 0.51, 1e-9);
  EXPECT_DOUBLE_EQ(summary.missing, 0.2);
  EXPECT_THAT(summary.never_visible, ElementsAre(1U));
  EXPECT_THAT(joined(summary), AllOf(HasSubstr("1 gap in time, the longest 0.51 s before frame 60"),
                                     HasSubstr("20 % of the samples missing"),
                                     HasSubstr("1 point is never visible: point 1")));
}

TEST(CheckTest, MillimetresAreRecognised) {
  Tracks tracks = bouncing(1e-4);
  for (Vec3d& x : tracks.positions) x *= 1000.0;
  EXPECT_THAT(summarise(tracks).unit_warning, HasSubstr("looks like millimetres"));
}

TEST(CheckTest, OneFrameIsEnough) {
  const CaptureSummary summary = summarise(bouncing(0.0, 1));
  EXPECT_EQ(summary.frames, 1U);
  EXPECT_EQ(summary.jump_count, 0U);
  EXPECT_EQ(summary.noise, 0.0);
  EXPECT_THAT(joined(summary), HasSubstr("one frame shows no motion"));
}

TEST(CheckTest, RefusesWhatCannotBeUsed) {
  const auto message = [](const Tracks& tracks) -> std::string {
    try {
      (void)summarise(tracks);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      return error.what();
    }
    return "nothing was thrown";
  };
  Tracks tracks = bouncing(0.0);
  std::swap(tracks.times[7], tracks.times[8]);
  EXPECT_THAT(message(tracks), HasSubstr("frame 8 is at 0.070000 s, not after frame 7"));
  tracks = bouncing(0.0);
  tracks.positions[11].x() = std::numeric_limits<double>::infinity();
  EXPECT_THAT(message(tracks), HasSubstr("point 1 at frame 2 is visible but"));
  tracks = bouncing(0.0);
  tracks.positions.pop_back();
  EXPECT_THAT(message(tracks), HasSubstr("need 1000 positions, there are 999"));
}

TEST(CheckTest, FramesThatAreExchanged) {
  Tracks tracks = bouncing(1e-5);
  EXPECT_TRUE(summarise(tracks).exchanged.empty());
  const auto at = [&](std::size_t frame) {
    return tracks.positions.begin() + std::ptrdiff_t(frame * tracks.points);
  };
  std::swap_ranges(at(6), at(7), at(7));
  EXPECT_THAT(summarise(tracks).exchanged, ElementsAre(6U));
  EXPECT_THAT(summarise(tracks).text, Contains(HasSubstr("frames 6 and 7 (counted")));
  std::swap_ranges(at(11), at(12), at(12));
  EXPECT_THAT(summarise(tracks).exchanged, ElementsAre(6U, 11U));
  EXPECT_THAT(summarise(tracks).exchanged_warning, HasSubstr("and 1 other pair:"));
}

TEST(CheckTest, WhatIsNotExchanged) {
  Tracks shaking = bouncing(0.0);  // near the frame rate, and carried along
  for (std::size_t i = 0; i < shaking.positions.size(); ++i) {
    const auto frame = static_cast<double>(i / shaking.points);
    shaking.positions[i] = Vec3d(0.01 * frame + (i / shaking.points % 2 == 0 ? 0.01 : -0.01), 0, 0);
  }
  EXPECT_TRUE(summarise(shaking).exchanged.empty());
  Tracks still = bouncing(0.0);  // with the digits of floats, of which most are the same
  for (std::size_t i = 0; i < still.positions.size(); ++i) {
    const std::size_t frame = i / still.points;
    const double place = static_cast<double>(i % still.points);
    const double digit = frame == 50 ? 2e-9 : frame == 51 ? 1e-9 : frame > 51 ? 3e-9 : 0.0;
    still.positions[i] = Vec3d(place + digit, 0, 0);
  }
  EXPECT_TRUE(summarise(still).exchanged.empty());
}

TEST(CheckTest, PointClouds) {
  PointCloudSequence clouds;
  clouds.source = "clouds";
  clouds.times = {0.0, 0.1, 0.2, 0.5};
  clouds.frames = {{}, {{1, 1, 1}, {2, 2, 2}}, {{1, 1, 0}}, {{1, 1, 1}, {2, 4, 2}, {1, 1, 1}}};
  const CloudSummary summary = summarise(clouds);
  EXPECT_EQ(summary.fewest, 0U);
  EXPECT_EQ(summary.most, 3U);
  EXPECT_THAT(summary.empty_frames, ElementsAre(0U));
  EXPECT_EQ(summary.low, Vec3d(1, 1, 0));
  EXPECT_EQ(summary.high, Vec3d(2, 4, 2));
  ASSERT_EQ(summary.gaps.size(), 1U);
  EXPECT_EQ(summary.gaps[0].frame, 3U);
  EXPECT_THAT(summary.text, Contains(HasSubstr("1 frame holds no points, the first is frame 0")));
}

// The recordings' own notes: a settled marker scatters by .005 to .014 mm.
TEST(CheckTest, BeamRecording) {
  const fs::path path = fs::path(MATTERFIT_DATA_DIR) / "beam" / "beam_gravity_V2_a.c3d";
  if (!fs::exists(path)) GTEST_SKIP() << "no beam recording at " << path;
  const CaptureSummary summary = summarise(read_tracks(path));
  EXPECT_GT(summary.noise, 0.002e-3) << joined(summary);
  EXPECT_LT(summary.noise, 0.02e-3) << joined(summary);
  EXPECT_EQ(summary.irregular, 0U);
  EXPECT_TRUE(summary.unit_warning.empty());
  for (const Jump& jump : summary.jumps) EXPECT_LT(jump.size, 2e-3) << joined(summary);
}

}  // namespace
}  // namespace matterfit::capture
