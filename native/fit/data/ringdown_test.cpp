// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/ringdown.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>
#include <vector>

#include "capture/tracks.hpp"

namespace matterfit::fit {
namespace {

using std::numbers::pi;

struct Record {
  std::vector<double> times;
  Points positions;
};

/// A ring-down of known parameters in direction (0, .6, −.8), with noise [m].
Record ring(double hz, double zeta, double drop, double drift, double noise, double seconds) {
  std::mt19937 engine(1);
  std::normal_distribution<double> normal(0.0, 1.0);
  Record record;
  const double omega = 2 * pi * hz;
  const double sigma = zeta * omega / std::sqrt(1 - zeta * zeta);
  for (int i = 0; i < int(seconds * 100); ++i) {
    const double t = i / 100.0;
    const double tau = t - 0.5;
    double s = 0.0;
    if (tau > 0) {
      s = drop - drift * std::exp(-tau / 0.7) -
          (drop - drift) * std::exp(-sigma * tau) * std::cos(omega * tau);
    }
    Vec3d x = Vec3d(1, 2, 3) + s * Vec3d(0, 0.6, -0.8);
    for (int k = 0; k < 3; ++k) x[k] += noise * normal(engine);
    record.times.push_back(t);
    record.positions.push_back(x);
  }
  return record;
}

TEST(Ringdown, RecoversItsOwnParameters) {
  const Record record = ring(7.25, 0.05, 6.8e-3, 0.3e-3, 0.0, 5.0);
  const auto found = fit_ringdown(record.times, record.positions, 0.5);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->frequency_hz, 7.25, 1e-6);
  EXPECT_NEAR(found->damping_ratio, 0.05, 1e-6);
  EXPECT_NEAR(found->drop_m, 6.8e-3 - 0.3e-3 * std::exp(-4.49 / 0.7), 1e-9);
  EXPECT_NEAR(found->drift_time_s, 0.7, 1e-4);
  EXPECT_NEAR(found->direction.dot(Vec3d(0, 0.6, -0.8)), 1.0, 1e-9);
  EXPECT_LT(found->residual_m, 1e-9);
}

TEST(Ringdown, SeesThatNothingDamps) {
  const Record record = ring(7.25, 0.0, 6.8e-3, 0.0, 0.0, 5.0);
  const auto found = fit_ringdown(record.times, record.positions, 0.5);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->frequency_hz, 7.25, 1e-6);
  EXPECT_NEAR(found->damping_ratio, 0.0, 1e-7);
  EXPECT_NEAR(found->drop_m, 6.8e-3, 1e-8);
}

TEST(Ringdown, StandsNoise) {
  const Record record = ring(4.35, 0.061, 17e-3, 0.5e-3, 2e-4, 6.0);
  const auto found = fit_ringdown(record.times, record.positions, 0.5);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->frequency_hz, 4.35, 0.02);
  EXPECT_NEAR(found->damping_ratio, 0.061, 0.003);
  EXPECT_NEAR(found->drop_m, 17e-3, 1e-4);
}

TEST(Ringdown, SkipsSamplesThatAreNotThere) {
  Record record = ring(7.25, 0.05, 6.8e-3, 0.0, 0.0, 5.0);
  for (std::size_t i = 60; i < 100; ++i) record.positions[i].x() = std::nan("");
  const auto found = fit_ringdown(record.times, record.positions, 0.5);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->frequency_hz, 7.25, 1e-5);
}

TEST(Ringdown, NothingRings) {
  Record record;
  for (int i = 0; i < 200; ++i) {
    record.times.push_back(i / 100.0);
    record.positions.emplace_back(0, 0, -std::max(0.0, i / 100.0 - 0.5));
  }
  EXPECT_FALSE(fit_ringdown(record.times, record.positions, 0.5));
  record.positions.assign(200, Vec3d::Zero());
  EXPECT_FALSE(fit_ringdown(record.times, record.positions, 0.5));
}

/// The recordings and what is published about them (README beside the files).
TEST(Ringdown, OfTheMeasuredBeam) {
  struct Case {
    const char* file;
    int release;
    double hz;
    double zeta;
    double drop_mm;
  };
  const Case cases[] = {{"beam_gravity_V2_a.c3d", 71, 7.73, 0.052, (6.63 + 6.52 + 6.22) / 3},
                        {"beam_gravity_V2_b.c3d", 65, 7.74, 0.054, (6.72 + 6.59 + 6.30) / 3},
                        {"beam_load52_V2_a.c3d", 43, 4.35, 0.061, (17.45 + 17.31 + 15.95) / 3}};
  for (const Case& expected : cases) {
    const std::filesystem::path file =
        std::filesystem::path(MATTERFIT_DATA_DIR) / "beam" / expected.file;
    if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not there";
    capture::TracksOptions options;
    options.markers = {"Tip - 1", "Tip - 2", "Tip - 3"};
    const capture::Tracks tracks = capture::read_tracks(file, options);
    Points mean(tracks.frames());
    for (std::size_t t = 0; t < tracks.frames(); ++t) {
      mean[t] = (tracks.position(t, 0) + tracks.position(t, 1) + tracks.position(t, 2)) / 3.0;
    }
    const double release = tracks.times.front() + expected.release / 100.0;
    const auto found = fit_ringdown(tracks.times, mean, release);
    ASSERT_TRUE(found) << expected.file;
    RecordProperty(expected.file, std::to_string(found->frequency_hz));
    EXPECT_NEAR(found->frequency_hz, expected.hz, 0.01 * expected.hz) << expected.file;
    EXPECT_NEAR(found->damping_ratio, expected.zeta, 0.004) << expected.file;
    // Published along marker x; the direction of largest motion leans off it by a few degrees.
    EXPECT_NEAR(1e3 * found->drop_m, expected.drop_mm, 0.03 * expected.drop_mm) << expected.file;
  }
}

}  // namespace
}  // namespace matterfit::fit
