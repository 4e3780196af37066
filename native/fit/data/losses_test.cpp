// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/losses.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();

TEST(TrackResiduals, AreDifferencesByTheNoise) {
  // Two frames of two points; the second point is not seen in the first frame.
  const Points simulated{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {1, 1, 1}};
  const Points captured{{1, 1, 1}, {kNoValue, 0, 0}, {7, 8, 8}, {2, 1, 1}};
  const std::vector<std::uint8_t> used{1, 0, 1, 1};
  const std::vector<double> sigma{0.5, 0.1};
  Eigen::VectorXd expected(12);
  expected << 0, 2, 4, 0, 0, 0, 0, 0, 2, -10, 0, 0;
  EXPECT_LT((track_residuals(simulated, captured, used, sigma, 2) - expected).norm(), 1e-13);
}

TEST(TrackResiduals, OfABrokenSimulationAreNotFinite) {
  const Points simulated{{kNoValue, 0, 0}};
  const Points captured{{0, 0, 0}};
  const std::vector<double> sigma{1.0};
  const std::vector<std::uint8_t> yes{1};
  const std::vector<std::uint8_t> no{0};
  EXPECT_FALSE(track_residuals(simulated, captured, yes, sigma, 1).allFinite());
  EXPECT_EQ(track_residuals(simulated, captured, no, sigma, 1).norm(), 0.0);
}

TEST(TrackResiduals, RefuseWhatDoesNotFit) {
  const Points two(2, Vec3d::Zero());
  const Points three(3, Vec3d::Zero());
  const std::vector<std::uint8_t> used(2, 1);
  const std::vector<double> sigma(2, 1.0);
  const auto refused = [&](const Points& a, const Points& b, const std::vector<std::uint8_t>& u,
                           const std::vector<double>& s, std::size_t points) {
    try {
      (void)track_residuals(a, b, u, s, points);
    } catch (const Error& error) {
      return error.kind() == ErrorKind::kInput;
    }
    return false;
  };
  EXPECT_FALSE(refused(two, two, used, sigma, 2));
  EXPECT_TRUE(refused(two, three, used, sigma, 2));
  EXPECT_TRUE(refused(two, two, {1}, sigma, 2));
  EXPECT_TRUE(refused(two, two, used, {1.0}, 2));
  EXPECT_TRUE(refused(two, two, used, {}, 0));
  EXPECT_TRUE(refused(three, three, {1, 1, 1}, sigma, 2));
  EXPECT_TRUE(refused(two, two, used, {1.0, 0.0}, 2));
  EXPECT_TRUE(refused(two, two, used, {1.0, kNoValue}, 2));
  EXPECT_TRUE(refused(two, {Vec3d::Zero(), Vec3d(0, kNoValue, 0)}, used, sigma, 2));
}

}  // namespace
}  // namespace matterfit::fit
