// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>

#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/test_problem.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::Vector2d;
using Eigen::VectorXd;

/// A decaying oscillation at forty times with noise that no parameters explain; `off` is how wrong
/// a stand-in is.
FunctionProblem oscillation(double off = 0.0) {
  return FunctionProblem([off](const VectorXd& x) -> std::optional<VectorXd> {
    VectorXd r(40);
    for (Index k = 0; k < r.size(); ++k) {
      const double t = 0.1 * double(k);
      const double at = std::exp(-(1.0 + off) * x[1] * t) * std::cos((1.0 - 0.5 * off) * x[0] * t);
      const double seen = std::exp(-0.3 * t) * std::cos(2.0 * t) + 0.01 * std::sin(37.0 * t * t);
      r[k] = 100.0 * (at - seen);
    }
    return r;
  });
}

TEST(StandIn, LeadsToTheMinimumOfTheProblemItself) {
  const LeastSquares fit(linear_parameters({1.7, 0.5}), {});
  FunctionProblem alone = oscillation();
  const LeastSquaresState expected = run(fit, alone);
  ASSERT_TRUE(expected.converged) << expected.reason;

  FunctionProblem problem = oscillation();
  FunctionProblem cheap = oscillation(0.1);
  problem.cheaper = &cheap;
  const LeastSquaresState found = run(fit, problem);
  EXPECT_TRUE(found.converged) << found.reason;
  EXPECT_NEAR(found.cost, expected.cost, 0.01);  // a tenth of a standard deviation
  // A Jacobian of two parameters is two evaluations: there is little to save.
  EXPECT_LE(problem.evaluations, alone.evaluations + 1);
  EXPECT_GT(cheap.evaluations, 0);
}

TEST(StandIn, ThatIsWrongIsGivenUp) {
  const LeastSquares fit(linear_parameters({1.7, 0.5}), {});
  FunctionProblem alone = oscillation();
  const LeastSquaresState expected = run(fit, alone);
  FunctionProblem problem = oscillation();
  FunctionProblem other([](const VectorXd& x) {
    VectorXd r(40);
    for (Index k = 0; k < r.size(); ++k) r[k] = double(k % 3) * x[0] - double(k % 2) * x[1];
    return r;
  });
  problem.cheaper = &other;
  const LeastSquaresState found = run(fit, problem);
  EXPECT_TRUE(found.converged) << found.reason;
  EXPECT_NEAR(found.cost, expected.cost, 0.01);
}

TEST(StandIn, ThatCannotBeEvaluatedIsGivenUp) {
  const LeastSquares fit(linear_parameters({1.7, 0.5}), {});
  FunctionProblem problem = oscillation();
  FunctionProblem broken([](const VectorXd&) { return std::nullopt; });
  problem.cheaper = &broken;
  EXPECT_TRUE(run(fit, problem).converged);
}

TEST(StandIn, GoesOnToTheSameBits) {
  const LeastSquares fit(linear_parameters({1.7, 0.5}), {});
  const auto whole = [&](bool stopped) {
    FunctionProblem problem = oscillation();
    FunctionProblem cheap = oscillation(0.1);
    problem.cheaper = &cheap;
    LeastSquaresState state = fit.start();
    while (!state.finished) {
      fit.iterate(problem, state);
      if (!stopped) continue;
      state.jacobian.resize(0, 0);
      state.unknown.clear();
    }
    fit.linearise(problem, state);
    return state;
  };
  const LeastSquaresState unbroken = whole(false);
  const LeastSquaresState resumed = whole(true);
  EXPECT_GT(unbroken.anchor.size(), 0);
  EXPECT_EQ(unbroken.point, resumed.point);
  EXPECT_EQ(unbroken.cost, resumed.cost);
  EXPECT_EQ(unbroken.evaluations, resumed.evaluations);
  EXPECT_EQ(unbroken.jacobian, resumed.jacobian);
}

TEST(StandIn, KeepsItsOwnJacobianForTheErrors) {
  const LeastSquares fit(linear_parameters({1.7, 0.5}), {});
  FunctionProblem problem = oscillation();
  FunctionProblem cheap = oscillation(0.1);
  problem.cheaper = &cheap;
  LeastSquaresState state = run(fit, problem);
  const int before = problem.evaluations;
  fit.linearise(problem, state);
  EXPECT_EQ(problem.evaluations, before);
  FunctionProblem alone = oscillation();
  LeastSquaresState central = fit.start();
  central.point = state.point;
  fit.linearise(alone, central);
  EXPECT_LT((state.jacobian - central.jacobian).norm(), 0.1 * central.jacobian.norm());
}

}  // namespace
}  // namespace matterfit::fit
