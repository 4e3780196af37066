// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/cloud_residuals.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "base/error.hpp"
#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/test_problem.hpp"

namespace matterfit::fit {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kNoise = 1e-4;

/// Random points in the unit ball, from `from` on.
Points ball(std::size_t count, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Points points;
  while (points.size() < count) {
    // One statement each: compilers call the arguments of a function in orders of their own.
    Vec3d x;
    for (int k = 0; k < 3; ++k) x[k] = uniform(engine);
    if (x.norm() < 1.0) points.push_back(x);
  }
  return points;
}

Points moved(Points points, const Vec3d& by) {
  for (Vec3d& x : points) x += by;
  return points;
}

Eigen::VectorXd residuals_of(const Points& simulated, const Points& captured,
                             const CloudScale& scale, Arena& arena) {
  return cloud_residuals(simulated, captured, cloud_means(captured, scale, arena), scale, arena);
}

double squares(const Points& simulated, const Points& captured, const CloudScale& scale) {
  Arena arena(2);
  return residuals_of(simulated, captured, scale, arena).squaredNorm();
}

TEST(CloudScale, ReachIsThreeSpacings) {
  Arena arena(2);
  for (const std::size_t count : {2000U, 16000U}) {
    const double spacing = std::cbrt(4.18879 / double(count));
    const CloudScale scale = cloud_scale(ball(count, 1), kNoise, arena);
    EXPECT_NEAR(scale.reach / spacing, 3.0, 0.35) << count;
  }
}

/// The noise of a coordinate is told from the points alone.
TEST(CloudScale, IsWhatSamplingsOfOneBodyMissEachOtherBy) {
  Arena arena(2);
  const Points dense = ball(30000, 2);
  for (const std::size_t count : {600U, 3000U}) {
    double sum = 0.0;
    double entries = 0.0;
    for (unsigned seed = 3; seed < 6; ++seed) {
      const Points captured = ball(count, seed);
      const CloudScale scale = cloud_scale(captured, kNoise, arena);
      const Eigen::VectorXd residual = residuals_of(dense, captured, scale, arena);
      EXPECT_EQ(residual.size(), Eigen::Index(6 * count));
      // Next to nothing for what no captured point is near.
      EXPECT_LT(residual.tail(Eigen::Index(3 * count)).norm(), 0.01);
      sum += residual.squaredNorm();
      entries += 3.0 * double(count);
    }
    EXPECT_NEAR(std::sqrt(sum / entries), 1.0, 0.1) << count;
  }
}

TEST(CloudScale, RefusesNothingAndNoNoise) {
  Arena arena(1);
  const Points one(1, Vec3d::Zero());
  EXPECT_THROW((void)cloud_scale({}, kNoise, arena), Error);
  EXPECT_THROW((void)cloud_scale(Points(2, Vec3d::Constant(kNan)), kNoise, arena), Error);
  EXPECT_THROW((void)cloud_scale(one, 0.0, arena), Error);
  EXPECT_THROW((void)cloud_scale(one, kNan, arena), Error);
  EXPECT_EQ(cloud_scale(one, kNoise, arena).sigma, kNoise);
}

TEST(CloudResiduals, LeadFromWithinASpacingToItsHundredth) {
  // Nearest points as they are would leave a cloud about where it is.
  Arena arena(2);
  const Points captured = ball(2000, 7);
  const Points simulated = ball(8000, 8);
  const CloudScale scale = cloud_scale(captured, kNoise, arena);
  FunctionProblem problem([&](const Eigen::VectorXd& x) {
    return residuals_of(moved(simulated, {x[0], x[1], x[2]}), captured, scale, arena);
  });
  const LeastSquares search(linear_parameters({0.1, -0.06, 0.05}), {});
  LeastSquaresState state = search.start();
  for (int i = 0; i < 6 && !state.finished; ++i) search.iterate(problem, state);
  // Sampling alone leaves a ball's centre √(1/5/2000) = .01 off.
  EXPECT_LT(state.point.norm(), 0.02);
}

TEST(CloudResiduals, FarOffAreVectorsToTheNearest) {
  Arena arena(1);
  const CloudScale scale{0.1, 0.5, 1.0};
  const Points simulated{{0, 0, 0}, {0, 0.2, 0}};
  const Points captured{{3, 0, 0}, {0, 5, 0}};
  Eigen::VectorXd expected(12);
  expected << -3, 0, 0, 0, -4.8, 0, -6 / std::sqrt(2.0), 0.2 / std::sqrt(2.0), 0, 0, 0, 0;
  expected /= 0.5;
  EXPECT_LT((residuals_of(simulated, captured, scale, arena) - expected).norm(), 1e-12);
}

TEST(CloudResiduals, DoNotJumpWhereTheyGoOverIntoThem) {
  const CloudScale scale{0.4, 1.0, 1.0};
  const Points captured = ball(300, 9);
  const Points simulated = ball(300, 10);
  double before = squares(simulated, captured, scale);
  for (int step = 1; step < 1200; ++step) {
    const double shift = 0.001 * step;
    const double now = squares(moved(simulated, {shift, 0, 0}), captured, scale);
    EXPECT_LT(std::abs(now - before), 0.01 * before + 0.05) << shift;
    before = now;
  }
}

TEST(CloudResiduals, LeaveOutCapturedPointsThatAreNotThere) {
  Arena arena(1);
  const Points a = ball(50, 11);
  const Points b = ball(40, 12);
  Points holes = b;
  holes.insert(holes.begin() + 7, Vec3d(kNan, 0, 0));
  const CloudScale scale = cloud_scale(holes, kNoise, arena);
  EXPECT_EQ(scale.reach, cloud_scale(b, kNoise, arena).reach);
  const Eigen::VectorXd residual = residuals_of(a, holes, scale, arena);
  ASSERT_EQ(residual.size(), 6 * 41);
  EXPECT_EQ(residual.segment<3>(Eigen::Index(3) * 7).norm(), 0.0);
  const double expected = residuals_of(a, b, scale, arena).squaredNorm();
  EXPECT_NEAR(residual.squaredNorm(), expected, 1e-9 * expected);
}

TEST(CloudResiduals, OfABrokenSimulationAreNotFinite) {
  Points a = ball(5, 13);
  const Points b = ball(5, 14);
  a[2].y() = std::numeric_limits<double>::infinity();
  Arena arena(1);
  const Eigen::VectorXd residual = residuals_of(a, b, cloud_scale(b, kNoise, arena), arena);
  EXPECT_EQ(residual.size(), 30);
  EXPECT_FALSE(residual.allFinite());
}

TEST(CloudResiduals, SameForAnyThreads) {
  const Points a = ball(6000, 15);
  const Points b = ball(5000, 16);
  Arena one(1);
  Arena two(2);
  const CloudScale scale = cloud_scale(b, kNoise, one);
  const CloudScale again = cloud_scale(b, kNoise, two);
  EXPECT_EQ(scale.reach, again.reach);
  EXPECT_EQ(scale.sigma, again.sigma);
  EXPECT_EQ(residuals_of(a, b, scale, one), residuals_of(a, b, scale, two));
}

TEST(CloudResiduals, RefuseEmptySets) {
  Arena arena(1);
  const Points a = ball(5, 17);
  const CloudScale scale = cloud_scale(a, kNoise, arena);
  EXPECT_THROW((void)cloud_residuals({}, a, a, scale, arena), Error);
  EXPECT_THROW((void)cloud_residuals(a, {}, {}, scale, arena), Error);
}

}  // namespace
}  // namespace matterfit::fit
