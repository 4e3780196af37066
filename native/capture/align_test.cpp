// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/align.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <random>

#include "base/error.hpp"
#include "base/message_for_test.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

const Points kPlaces = {{0, .015, .036},       {0, -.006, .024},     {0, .036, .006},
                        {-.094, -.010, -.001}, {-.094, .040, .0275}, {-.094, .040, 0}};

// Any proper motion is found exactly, from points in general position and from a flat set, for
// which a mirrored solution fits as well.
TEST(AlignTest, RecoversARigidMotion) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 50; ++trial) {
    const Quatd q =
        Quatd(normal(random), normal(random), normal(random), normal(random)).normalized();
    const Vec3d shift(normal(random), normal(random), normal(random));
    Points from = kPlaces;
    if (trial % 2 == 1) {
      for (Vec3d& x : from) x.x() = 0.0;
    }
    Points to;
    for (const Vec3d& x : from) to.emplace_back(q * x + shift);
    const RigidFit fit = fit_rigid(from, to);
    EXPECT_LT((fit.rotation - q.toRotationMatrix()).norm(), 1e-9);
    EXPECT_LT((fit.translation - shift).norm(), 1e-9);
    EXPECT_NEAR(fit.rotation.determinant(), 1.0, 1e-12);
    EXPECT_LT(fit.rms_mm, 1e-9);
  }
}

// Four points of a square and one whose mirror image would fit better: still a rotation.
TEST(AlignTest, NeverMirrors) {
  const Points from = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}};
  Points to = from;
  for (Vec3d& x : to) x.z() = -x.z();
  EXPECT_NEAR(fit_rigid(from, to).rotation.determinant(), 1.0, 1e-12);
  EXPECT_GT(fit_rigid(from, to).rms_mm, 1.0);
}

TEST(AlignTest, ExcludedPointsAreOnlyReported) {
  Points to = kPlaces;
  to[4] += Vec3d(0.003, 0, 0);
  Tracks tracks;
  tracks.points = 6;
  tracks.times = {0.0, 1.0};
  for (int frame = 0; frame < 2; ++frame) {
    for (const Vec3d& x : kPlaces) {
      tracks.positions.emplace_back(x + Vec3d(0, 0, frame == 0 ? -1e-3 : 1e-3));
    }
  }
  AlignOptions options;
  options.end = 2;
  options.exclude = {4};
  const RigidFit fit = align_tracks(tracks, to, options);
  EXPECT_LT((fit.matrix() - Eigen::Matrix4d::Identity()).norm(), 1e-12);
  EXPECT_NEAR(fit.residual_mm[4], 3.0, 1e-9);
  EXPECT_LT(fit.rms_mm, 1e-9);
}

TEST(AlignTest, WhatDoesNotDetermineAMotionIsRefused) {
  const Points line = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {5, 5, 5}};
  EXPECT_THAT(message_of([&] { (void)fit_rigid(line, line); }), HasSubstr("on one line"));
  const Points same(4, Vec3d(1, 2, 3));
  EXPECT_THAT(message_of([&] { (void)fit_rigid(same, same); }), HasSubstr("on one line"));
  EXPECT_THAT(message_of([&] {
                (void)fit_rigid(kPlaces, kPlaces, std::vector<double>{1, 1, 0, 0, 0, 0});
              }),
              HasSubstr("at least 3 points, 2 take part"));
  Points lost = kPlaces;
  lost[1].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message_of([&] { (void)fit_rigid(lost, kPlaces); }),
              HasSubstr("point 1 has no position"));
  Tracks tracks;
  tracks.points = 1;
  tracks.times = {0.0};
  tracks.positions = {Vec3d::Zero()};
  EXPECT_THAT(message_of([&] { (void)mean_positions(tracks, 0, 2); }),
              HasSubstr("frames 0 up to, and without, 2 do not lie"));
}

// The beam at rest, on the places that its data's notes give: they say that a rigid fit leaves .2
// to 1.5 mm, that the sag is along marker −x, and that the beam's axis is some 7° off marker z.
TEST(AlignTest, BeamMarkersOnTheModel) {
  const fs::path path = fs::path(MATTERFIT_DATA_DIR) / "beam" / "beam_gravity_V2_a.c3d";
  if (!fs::exists(path)) GTEST_SKIP() << "no beam recording at " << path;
  const Tracks tracks = read_tracks(path);
  AlignOptions options;
  options.end = 60;
  options.exclude = {4};
  const RigidFit fit = align_tracks(tracks, kPlaces, options);
  for (const std::size_t point : {0U, 1U, 2U, 3U, 5U}) {
    EXPECT_LT(fit.residual_mm[point], 1.5) << tracks.labels[point];
  }
  EXPECT_LT(fit.rms_mm, 1.0);
  EXPECT_GT(fit.rms_mm, 0.1);
  const Vec3d down = fit.rotation * Vec3d(-1, 0, 0);
  EXPECT_GT(-down.z(), 0.9) << "marker -x is down on the model";
  const Vec3d axis = fit.rotation * Vec3d::UnitZ();
  EXPECT_NEAR(std::acos(axis.x()) * 180.0 / M_PI, 7.0, 2.0);
}

}  // namespace
}  // namespace matterfit::capture
