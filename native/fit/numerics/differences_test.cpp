// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/differences.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "fit/numerics/test_problem.hpp"

namespace matterfit::fit {
namespace {

using Eigen::VectorXd;

std::vector<Parameter> linear(std::size_t count) {
  return linear_parameters(std::vector<double>(count, 0.0), -10.0, 10.0);
}

Box box(std::size_t n, double low, double high) {
  const auto size = Eigen::Index(n);
  return {VectorXd::Constant(size, low), VectorXd::Constant(size, high)};
}

/// (x², xy)
std::optional<VectorXd> curved(const VectorXd& x) {
  return VectorXd(Eigen::Vector2d(x[0] * x[0], x[0] * x[1]));
}

TEST(Differences, ForwardAndCentralHaveTheirErrors) {
  FunctionProblem problem(curved);
  const VectorXd at = Eigen::Vector2d(2.0, 3.0);
  const double h = 0.01;
  const auto forward = differences(problem, linear(2), box(2, -10, 10), at, {}, h, false);
  EXPECT_EQ(forward.evaluations, 3);
  EXPECT_EQ(forward.residual, *curved(at));
  EXPECT_NEAR(forward.jacobian(0, 0), 4.0 + h, 1e-12);  // the derivative and h/2 of the second
  EXPECT_NEAR(forward.jacobian(1, 1), 2.0, 1e-12);
  const auto central =
      differences(problem, linear(2), box(2, -10, 10), at, forward.residual, h, true);
  EXPECT_EQ(central.evaluations, 4);
  EXPECT_NEAR(central.jacobian(0, 0), 4.0, 1e-12);
  EXPECT_NEAR(central.jacobian(1, 0), 3.0, 1e-12);
  EXPECT_NEAR(central.jacobian(0, 1), 0.0, 1e-12);
  // All that can be done side by side is asked for at once.
  EXPECT_EQ(problem.batches, 2);
}

TEST(Differences, StepsAreInUnitsOfTheScale) {
  FunctionProblem problem(curved);
  auto parameters = linear(2);
  parameters[0].scale = 20.0;
  const auto found =
      differences(problem, parameters, box(2, -10, 10), Eigen::Vector2d(2, 3), {}, 0.01, false);
  EXPECT_NEAR(found.jacobian(0, 0), 4.2, 1e-12);
  const auto central =
      differences(problem, parameters, box(2, -10, 10), Eigen::Vector2d(2, 3), {}, 0.01, true);
  EXPECT_NEAR(central.jacobian(0, 0), 4.0, 1e-12);
}

TEST(Differences, StayWithinBounds) {
  for (const bool central : {false, true}) {
    for (const double at : {-1.0, -0.999, 0.0, 0.998, 1.0}) {
      FunctionProblem problem([](const VectorXd& x) {
        EXPECT_GE(x[0], -1.0);
        EXPECT_LE(x[0], 1.0);
        return std::optional<VectorXd>(3.0 * x);
      });
      const auto found = differences(problem, linear(1), box(1, -1, 1), VectorXd::Constant(1, at),
                                     {}, 0.01, central);
      EXPECT_NEAR(found.jacobian(0, 0), 3.0, 1e-11) << at;
      EXPECT_EQ(found.unknown[0], 0);
    }
  }
  // Bounds nearer than the step on both sides.
  FunctionProblem problem([](const VectorXd& x) { return std::optional<VectorXd>(3.0 * x); });
  const auto narrow =
      differences(problem, linear(1), box(1, -1e-5, 2e-5), VectorXd::Zero(1), {}, 0.01, true);
  EXPECT_NEAR(narrow.jacobian(0, 0), 3.0, 1e-11);
}

TEST(Differences, TryTheOtherSideAndShorterSteps) {
  for (const bool central : {false, true}) {
    // Only below 2, only within .004 of it, not at all.
    FunctionProblem problem([](const VectorXd& x) -> std::optional<VectorXd> {
      if (x[0] > 2.0 || std::abs(x[1] - 2.0) > 0.004 || x[2] != 2.0) return std::nullopt;
      VectorXd r = 3.0 * x;
      return r;
    });
    const VectorXd at = VectorXd::Constant(3, 2.0);
    const auto found = differences(problem, linear(3), box(3, -10, 10), at, {}, 0.01, central);
    EXPECT_NEAR(found.jacobian(0, 0), 3.0, 1e-10);
    EXPECT_NEAR(found.jacobian(1, 1), 3.0, 1e-10);
    EXPECT_EQ(found.jacobian.col(2).norm(), 0.0);
    EXPECT_EQ(found.unknown, (std::vector<std::uint8_t>{0, 0, 1}));
  }
}

TEST(Differences, NotFiniteIsAFailure) {
  FunctionProblem problem([](const VectorXd& x) {
    VectorXd r = x;
    if (x[0] > 1.0) r[0] = std::numeric_limits<double>::quiet_NaN();
    return std::optional<VectorXd>(r);
  });
  const auto found =
      differences(problem, linear(1), box(1, -10, 10), VectorXd::Ones(1), {}, 0.01, false);
  EXPECT_NEAR(found.jacobian(0, 0), 1.0, 1e-12);
}

TEST(Differences, ThePointItselfMustBeEvaluated) {
  FunctionProblem problem([](const VectorXd&) { return std::nullopt; });
  try {
    (void)differences(problem, linear(1), box(1, -10, 10), VectorXd::Ones(1), {}, 0.01, false);
    FAIL() << "a starting point that fails was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kCompute);
  }
}

TEST(Differences, AsManyResidualsEachTime) {
  FunctionProblem growing([](const VectorXd& x) {
    return std::optional<VectorXd>(VectorXd::Ones(x[0] > 1.0 ? 2 : 3));
  });
  EXPECT_THROW(
      (void)differences(growing, linear(1), box(1, -10, 10), VectorXd::Ones(1), {}, 0.01, false),
      Error);
  FunctionProblem none([](const VectorXd&) { return std::optional<VectorXd>(VectorXd()); });
  EXPECT_THROW(
      (void)differences(none, linear(1), box(1, -10, 10), VectorXd::Ones(1), {}, 0.01, false),
      Error);
}

}  // namespace
}  // namespace matterfit::fit
