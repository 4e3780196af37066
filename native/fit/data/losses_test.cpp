// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/losses.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "base/error.hpp"
#include "fit/data/metrics.hpp"

namespace matterfit::fit {
namespace {

constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();

Points random_points(std::size_t count, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  Points points(count);
  for (Vec3d& x : points) x = Vec3d(uniform(engine), uniform(engine), uniform(engine));
  return points;
}

/// Largest difference of a gradient from central differences of its value, against its largest
/// component.
double gradient_error(const Points& at, const std::function<LossGradient(const Points&)>& loss) {
  const LossGradient exact = loss(at);
  EXPECT_EQ(exact.gradient.size(), at.size());
  double largest = 0.0;
  double error = 0.0;
  const double h = 1e-6;
  for (std::size_t i = 0; i < at.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      Points beside = at;
      beside[i][k] = at[i][k] + h;
      const double ahead = loss(beside).value;
      beside[i][k] = at[i][k] - h;
      const double behind = loss(beside).value;
      error = std::max(error, std::abs(exact.gradient[i][k] - (ahead - behind) / (2.0 * h)));
      largest = std::max(largest, std::abs(exact.gradient[i][k]));
    }
  }
  EXPECT_GT(largest, 0.0);
  return error / largest;
}

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

TEST(TrajectoryLoss, IsTheMeanL1Distance) {
  const Points simulated{{1, 2, 3}, {4, 5, 6}, {0, 0, 0}};
  const Points captured{{0, 4, 3}, {kNoValue, kNoValue, kNoValue}, {0, 0, -1}};
  const std::vector<std::uint8_t> used{1, 0, 1};
  const LossGradient loss = trajectory_loss(simulated, captured, used);
  EXPECT_DOUBLE_EQ(loss.value, 2.0);
  EXPECT_EQ(loss.gradient[0], Vec3d(0.5, -0.5, 0.0));
  EXPECT_EQ(loss.gradient[1], Vec3d(0, 0, 0));
  EXPECT_EQ(loss.gradient[2], Vec3d(0.0, 0.0, 0.5));
}

TEST(TrajectoryLoss, HuberIsQuadraticNearAndLinearFar) {
  const Points simulated{{0.3, 0, 0}, {0, 5, 0}};
  const Points captured{{0, 0, 0}, {0, 0, 0}};
  const std::vector<std::uint8_t> used{1, 1};
  const LossGradient loss = trajectory_loss(simulated, captured, used, 2.0);
  EXPECT_DOUBLE_EQ(loss.value, 0.5 * (0.5 * 0.09 + 2.0 * (5.0 - 1.0)));
  EXPECT_DOUBLE_EQ(loss.gradient[0].x(), 0.15);
  EXPECT_DOUBLE_EQ(loss.gradient[1].y(), 1.0);
}

TEST(TrajectoryLoss, GradientIsThatOfTheValue) {
  const Points captured = random_points(40, 1);
  std::vector<std::uint8_t> used(40, 1);
  used[3] = used[17] = 0;
  for (const double huber : {0.0, 0.2, 0.6, 10.0}) {
    const auto loss = [&](const Points& x) { return trajectory_loss(x, captured, used, huber); };
    EXPECT_LT(gradient_error(random_points(40, 2), loss), 1e-6) << huber;
  }
}

TEST(TrajectoryLoss, RefusesNothingUsed) {
  const Points one(1, Vec3d::Zero());
  const std::vector<std::uint8_t> none{0};
  const std::vector<std::uint8_t> all{1};
  EXPECT_THROW((void)trajectory_loss(one, one, none), Error);
  EXPECT_THROW((void)trajectory_loss(one, one, all, -1.0), Error);
}

TEST(ChamferLoss, IsTheMetric) {
  const Points a = random_points(500, 3);
  const Points b = random_points(300, 4);
  Arena arena(2);
  EXPECT_NEAR(chamfer_loss(a, b, arena).value, chamfer(a, b, arena), 1e-15);
}

TEST(ChamferLoss, GradientIsThatOfTheValue) {
  const Points captured = random_points(60, 5);
  Arena arena(1);
  const auto loss = [&](const Points& x) { return chamfer_loss(x, captured, arena); };
  EXPECT_LT(gradient_error(random_points(80, 6), loss), 1e-6);
  EXPECT_LT(gradient_error(random_points(30, 7), loss), 1e-6);
}

TEST(ChamferLoss, SameForAnyThreads) {
  const Points a = random_points(6000, 8);
  const Points b = random_points(5000, 9);
  Arena one(1);
  Arena two(2);
  const LossGradient first = chamfer_loss(a, b, one);
  const LossGradient second = chamfer_loss(a, b, two);
  EXPECT_EQ(first.value, second.value);
  EXPECT_EQ(first.gradient, second.gradient);
}

TEST(ChamferLoss, LeavesOutCapturedPointsThatAreNotThere) {
  const Points a = random_points(50, 10);
  const Points b = random_points(40, 11);
  Points holes = b;
  holes.insert(holes.begin() + 7, Vec3d(kNoValue, 0, 0));
  Arena arena(1);
  const LossGradient expected = chamfer_loss(a, b, arena);
  const LossGradient found = chamfer_loss(a, holes, arena);
  EXPECT_EQ(found.value, expected.value);
  EXPECT_EQ(found.gradient, expected.gradient);
}

TEST(ChamferLoss, OfABrokenSimulationIsNotFinite) {
  Points a = random_points(5, 12);
  const Points b = random_points(5, 13);
  a[2].y() = std::numeric_limits<double>::infinity();
  Arena arena(1);
  EXPECT_TRUE(std::isnan(chamfer_loss(a, b, arena).value));
}

TEST(ChamferLoss, RefusesEmptySets) {
  const Points a = random_points(5, 14);
  Arena arena(1);
  EXPECT_THROW((void)chamfer_loss({}, a, arena), Error);
  EXPECT_THROW((void)chamfer_loss(a, Points{Vec3d(kNoValue, 0, 0)}, arena), Error);
}

}  // namespace
}  // namespace matterfit::fit
