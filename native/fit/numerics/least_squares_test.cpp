// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/least_squares.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>

#include "base/error.hpp"
#include "fit/numerics/test_problem.hpp"

namespace matterfit::fit {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using testing::HasSubstr;

/// A x − b.
FunctionProblem affine(const MatrixXd& a, const VectorXd& b) {
  return FunctionProblem([a, b](const VectorXd& x) { return VectorXd(a * x - b); });
}

TEST(LeastSquares, Rosenbrock) {
  FunctionProblem problem(rosenbrock);
  const LeastSquares fit(linear_parameters({-1.2, 1.0}), exact());
  const auto state = run(fit, problem);
  EXPECT_TRUE(state.converged) << state.reason;
  EXPECT_NEAR(state.point[0], 1.0, 1e-8);
  EXPECT_NEAR(state.point[1], 1.0, 1e-8);
  EXPECT_EQ(state.evaluations, problem.evaluations);
}

TEST(LeastSquares, RosenbrockWithTheStepsOfASimulation) {
  FunctionProblem problem(rosenbrock);
  LeastSquaresOptions options;
  options.iterations = 100;
  const LeastSquares fit(linear_parameters({-1.2, 1.0}), options);
  const auto state = run(fit, problem);
  EXPECT_TRUE(state.converged) << state.reason;
  EXPECT_NEAR(state.point[0], 1.0, 1e-3);
  EXPECT_NEAR(state.point[1], 1.0, 2e-3);
}

TEST(LeastSquares, HelicalValley) {
  FunctionProblem problem([](const VectorXd& x) {
    double turn = std::atan(x[1] / x[0]) / (2.0 * std::numbers::pi);
    if (x[0] < 0.0) turn += 0.5;
    return VectorXd(
        Vector3d(10.0 * (x[2] - 10.0 * turn), 10.0 * (std::hypot(x[0], x[1]) - 1.0), x[2]));
  });
  const LeastSquares fit(linear_parameters({-1.0, 0.0, 0.0}), exact());
  const auto state = run(fit, problem);
  EXPECT_LT((state.point - Vector3d(1, 0, 0)).norm(), 1e-6) << state.reason;
}

TEST(LeastSquares, PowellsSingularFunction) {
  // The Jacobian is singular at the minimum.
  FunctionProblem problem([](const VectorXd& x) {
    return VectorXd(Vector4d(x[0] + 10.0 * x[1], std::sqrt(5.0) * (x[2] - x[3]),
                             std::pow(x[1] - 2.0 * x[2], 2),
                             std::sqrt(10.0) * std::pow(x[0] - x[3], 2)));
  });
  const LeastSquares fit(linear_parameters({3.0, -1.0, 0.0, 1.0}), exact());
  const auto state = run(fit, problem);
  EXPECT_LT(state.point.norm(), 1e-2) << state.reason;
  EXPECT_LT(state.cost, 1e-10);
}

TEST(LeastSquares, ActiveBoundsGiveTheConstrainedMinimum) {
  // Free minimum at (3, -2), x₀ ≤ 1. Cutting off there would leave x₁ at −2.
  MatrixXd a(3, 2);
  a << 1, 0.9, 0, 0.5, 0.3, -0.2;
  const VectorXd b = a * Vector2d(3, -2);
  const VectorXd rest = b - a.col(0);
  const double expected = a.col(1).dot(rest) / a.col(1).squaredNorm();
  FunctionProblem problem = affine(a, b);
  auto parameters = linear_parameters({0.0, 0.0}, -10.0, 10.0);
  parameters[0].high = 1.0;
  const auto state = run(LeastSquares(parameters, exact()), problem);
  EXPECT_TRUE(state.converged) << state.reason;
  EXPECT_EQ(state.point[0], 1.0);
  EXPECT_NEAR(state.point[1], expected, 1e-8);
  EXPECT_GT(std::abs(expected + 2.0), 1.0);
}

TEST(LeastSquares, StartsAtABoundAndLeavesOrStays) {
  const auto inside = [](const VectorXd& x) {
    EXPECT_GE(x.minCoeff(), 0.0);
    EXPECT_LE(x.maxCoeff(), 2.0);
    return VectorXd(Vector3d(x[0] - 1.0, x[1] - 5.0, x[2] + x[0] - 1.5));
  };
  FunctionProblem problem(inside);
  const auto parameters = linear_parameters({0.0, 2.0, 2.0}, 0.0, 2.0);
  const auto state = run(LeastSquares(parameters, exact()), problem);
  EXPECT_TRUE(state.converged) << state.reason;
  EXPECT_NEAR(state.point[0], 1.0, 1e-8);
  EXPECT_EQ(state.point[1], 2.0);
  EXPECT_NEAR(state.point[2], 0.5, 1e-8);
}

TEST(LeastSquares, ReachesBoundsToTheLastBitAndNeverGoesBeyond) {
  std::mt19937 engine(1);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int trial = 0; trial < 100; ++trial) {
    const double low = -uniform(engine);
    const double high = uniform(engine);
    FunctionProblem problem([&](const VectorXd& x) {
      EXPECT_GE(x.minCoeff(), low);
      EXPECT_LE(x.maxCoeff(), high);
      return VectorXd(Vector3d(x[0] - 3.0, 0.7 * x[1] + 2.0, 0.3 * x[0] * x[1]));
    });
    const auto state = run(LeastSquares(linear_parameters({0.0, 0.0}, low, high), {}), problem);
    EXPECT_EQ(state.point, VectorXd(Vector2d(high, low)));
  }
}

TEST(LeastSquares, AFailedEvaluationMakesTheStepShorter) {
  // Gauss–Newton from 0.1 overshoots far into where nothing can be evaluated.
  int failures = 0;
  FunctionProblem problem([&](const VectorXd& x) -> std::optional<VectorXd> {
    if (x[0] > 2.0) {
      ++failures;
      return std::nullopt;
    }
    return VectorXd(VectorXd::Constant(1, std::sqrt(x[0]) * std::sqrt(x[0]) * x[0] - 3.61));
  });
  const auto state = run(LeastSquares(linear_parameters({0.1}, 0.01, 1e3), exact()), problem);
  EXPECT_GT(failures, 0);
  EXPECT_TRUE(state.converged) << state.reason;
  EXPECT_NEAR(state.point[0], 1.9, 1e-8);
}

TEST(LeastSquares, AnEdgeOfFailureIsNoConvergence) {
  // The minimum lies beyond where evaluations fail; it comes near, and says that.
  FunctionProblem problem([](const VectorXd& x) -> std::optional<VectorXd> {
    if (x[0] > 2.0) return std::nullopt;
    return VectorXd(VectorXd::Constant(1, x[0] - 3.0));
  });
  LeastSquaresOptions options;
  options.iterations = 200;
  const auto state = run(LeastSquares(linear_parameters({0.0}), options), problem);
  EXPECT_FALSE(state.converged);
  EXPECT_THAT(state.reason, HasSubstr("simulated"));
  EXPECT_GT(state.point[0], 1.9);
  EXPECT_LE(state.point[0], 2.0);
}

TEST(LeastSquares, AParameterThatCannotBeExaminedStaysAndIsNoConvergence) {
  FunctionProblem problem([](const VectorXd& x) -> std::optional<VectorXd> {
    if (x[1] != 2.0) return std::nullopt;
    return VectorXd(Vector2d(x[0] - 1.0, 0.5 * x[0]));
  });
  auto parameters = linear_parameters({0.0, 2.0});
  parameters[1].prior = Prior{3.0, 1.0};
  for (const double step_tolerance : {0.0, 0.01}) {
    LeastSquaresOptions options = exact();
    options.step_tolerance = step_tolerance;
    const auto state = run(LeastSquares(parameters, options), problem);
    EXPECT_NEAR(state.point[0], 0.8, 0.01);
    EXPECT_EQ(state.point[1], 2.0);
    EXPECT_FALSE(state.converged) << state.reason;
    EXPECT_EQ(state.unknown, (std::vector<std::uint8_t>{0, 1}));
  }
}

TEST(LeastSquares, AStartThatFailsIsAnErrorAndLeavesTheState) {
  FunctionProblem problem([](const VectorXd&) { return std::nullopt; });
  const LeastSquares fit(linear_parameters({0.0}), exact());
  LeastSquaresState state = fit.start();
  try {
    fit.iterate(problem, state);
    FAIL() << "a starting point that fails was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kCompute);
  }
  EXPECT_EQ(state.residual.size(), 0);
  EXPECT_FALSE(state.finished);
}

TEST(LeastSquares, WhatNothingObservesStaysAndSpoilsNothing) {
  const auto with = [](const VectorXd& x) {
    return VectorXd(Vector3d(10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0], 0.5));
  };
  FunctionProblem problem(with);
  const auto alone = run(LeastSquares(linear_parameters({-1.2, 1.0}), exact()), problem);
  const auto state = run(LeastSquares(linear_parameters({-1.2, 1.0, 7.0}), exact()), problem);
  EXPECT_EQ(state.point[2], 7.0);
  EXPECT_EQ(state.iteration, alone.iteration);
  EXPECT_LT((state.point.head<2>() - alone.point).norm(), 1e-9);
}

TEST(LeastSquares, WhatIsHardlyObservedDoesNotJump) {
  // The third column is rounding.
  FunctionProblem problem([](const VectorXd& x) {
    return VectorXd(Vector3d(1e3 * (x[0] - 1.0), 1e3 * (x[1] - x[0]), 1.0 + 1e-6 * x[2]));
  });
  LeastSquaresOptions options;
  const auto state = run(LeastSquares(linear_parameters({0.0, 0.0, 7.0}), options), problem);
  EXPECT_NEAR(state.point[0], 1.0, 1e-3);
  EXPECT_NEAR(state.point[1], 1.0, 1e-3);
  EXPECT_NEAR(state.point[2], 7.0, 1.0);
}

TEST(LeastSquares, NothingObservedAtAllIsSaid) {
  FunctionProblem problem([](const VectorXd&) { return VectorXd(Vector2d(1.0, 2.0)); });
  const auto state = run(LeastSquares(linear_parameters({1.0, 2.0}), exact()), problem);
  EXPECT_FALSE(state.converged);
  EXPECT_EQ(state.point, VectorXd(Vector2d(1.0, 2.0)));
  EXPECT_THAT(state.reason, HasSubstr("Nothing"));
}

TEST(LeastSquares, OnlyASumObservedStillConverges) {
  FunctionProblem problem([](const VectorXd& x) {
    return VectorXd(Vector2d(x[0] + x[1] - 2.0, 2.0 * (x[0] + x[1]) - 5.0));
  });
  const auto state = run(LeastSquares(linear_parameters({0.5, -3.0}), exact()), problem);
  EXPECT_TRUE(state.converged) << state.reason;
  EXPECT_NEAR(state.point.sum(), 2.4, 1e-8);
  EXPECT_NEAR(state.point[0] - state.point[1], 3.5, 1e-3);  // moved no more than was needed
}

TEST(LeastSquares, TheScaleOfTheCostDoesNotMatter) {
  // By powers of two nothing is rounded otherwise.
  std::vector<LeastSquaresState> states;
  for (const double factor : {1.0, std::ldexp(1.0, -200), std::ldexp(1.0, 200)}) {
    FunctionProblem problem([&](const VectorXd& x) {
      return VectorXd(factor * Vector3d(10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0], 0.3 * x[1]));
    });
    states.push_back(run(LeastSquares(linear_parameters({-1.2, 1.0}), exact()), problem));
    EXPECT_TRUE(states.back().converged) << states.back().reason;
    EXPECT_EQ(states.back().point, states.front().point) << factor;
    EXPECT_EQ(states.back().iteration, states.front().iteration) << factor;
  }
}

TEST(LeastSquares, UnitsOfAParameterDoNotMatter) {
  // The second in units a million times smaller, with its bounds and scale.
  FunctionProblem one(rosenbrock);
  FunctionProblem other([](const VectorXd& x) { return rosenbrock(Vector2d(x[0], 1e-6 * x[1])); });
  auto parameters = linear_parameters({-1.2, 1.0});
  const auto expected = run(LeastSquares(parameters, exact()), one);
  parameters[1].start *= 1e6;
  parameters[1].low *= 1e6;
  parameters[1].high *= 1e6;
  parameters[1].scale *= 1e6;
  const auto state = run(LeastSquares(parameters, exact()), other);
  EXPECT_NEAR(state.point[0], expected.point[0], 1e-9);
  EXPECT_NEAR(state.point[1], 1e6 * expected.point[1], 1e-3);
  EXPECT_NEAR(state.iteration, expected.iteration, 2);
}

TEST(LeastSquares, LogarithmsFromFourDecadesAway) {
  // A modulus that is seen as a rate, which is ∝ √E. Never a step of more than a factor ten.
  double from = 0.0;
  double farthest = 0.0;
  FunctionProblem problem([&](const VectorXd& x) {
    farthest = std::max(farthest, std::abs(x[0] - from));
    VectorXd r(40);
    for (int i = 0; i < 40; ++i) {
      const double t = 0.05 * i;
      r[i] = 100.0 * (std::exp(-t * std::exp(0.5 * x[0]) / 300.0) - std::exp(-t));
    }
    return r;
  });
  for (const double start : {9.0, 9e8}) {
    auto parameters = linear_parameters({start}, 1.0, 1e10);
    parameters[0].coordinate = Coordinate::kLog;
    const LeastSquares fit(parameters, exact());
    LeastSquaresState state = fit.start();
    while (!state.finished) {
      farthest = 0.0;
      from = state.point[0];
      fit.iterate(problem, state);
      EXPECT_LT(farthest, std::log(10.0) + 1e-5);
    }
    EXPECT_TRUE(state.converged) << state.reason;
    EXPECT_NEAR(std::exp(state.point[0]), 9e4, 1.0) << start;
  }
}

TEST(LeastSquares, PriorsGiveThePosterior) {
  MatrixXd a(3, 2);
  a << 1, 0.5, 0.2, 1, 0.4, 0.4;
  const Vector3d b(1.0, 2.0, -1.0);
  FunctionProblem problem = affine(a, b);
  auto parameters = linear_parameters({0.0, 0.0});
  parameters[0].prior = Prior{2.0, 0.5};
  parameters[1].prior = Prior{-1.0, 3.0};
  MatrixXd hessian = a.transpose() * a;
  hessian(0, 0) += 4.0;
  hessian(1, 1) += 1.0 / 9.0;
  const VectorXd right = a.transpose() * b + Vector2d(8.0, -1.0 / 9.0);
  const auto state = run(LeastSquares(parameters, exact()), problem);
  EXPECT_LT((state.point - hessian.inverse() * right).norm(), 1e-8);
  EXPECT_EQ(state.residual.size(), 3);
  const Vector2d off((state.point[0] - 2.0) / 0.5, (state.point[1] + 1.0) / 3.0);
  EXPECT_NEAR(state.cost, 0.5 * ((a * state.point - b).squaredNorm() + off.squaredNorm()), 1e-12);
}

TEST(LeastSquares, WhatOnlyAPriorKnowsGoesToIt) {
  FunctionProblem problem([](const VectorXd& x) { return VectorXd(Vector2d(x[0] - 1.0, 3.0)); });
  auto parameters = linear_parameters({0.0, 0.0});
  parameters[1].prior = Prior{4.0, 0.5};
  const auto state = run(LeastSquares(parameters, exact()), problem);
  EXPECT_NEAR(state.point[0], 1.0, 1e-8);
  EXPECT_NEAR(state.point[1], 4.0, 1e-6);
}

TEST(LeastSquares, HuberIsTheEstimatorOfALocation) {
  // Σ ψ(x − b) = 4 x − 1 = 0.
  const VectorXd b = (VectorXd(5) << 0, 0, 0, 0, 10).finished();
  FunctionProblem problem = affine(VectorXd::Ones(5), b);
  LeastSquaresOptions options = exact();
  options.huber = 1.0;
  const auto state = run(LeastSquares(linear_parameters({0.0}), options), problem);
  EXPECT_NEAR(state.point[0], 0.25, 1e-7);
  EXPECT_NEAR(state.cost, 0.5 * (4 * 0.0625 + 2 * 9.75 - 1), 1e-9);
}

TEST(LeastSquares, ARoughCostEndsTheSearch) {
  // Ripples that the differences take for slopes.
  FunctionProblem problem([](const VectorXd& x) {
    return VectorXd(Vector2d(x[0] - 1.0 + 0.002 * std::sin(3e3 * x[0]), 0.3));
  });
  LeastSquaresOptions options;
  const auto state = run(LeastSquares(linear_parameters({5.0}), options), problem);
  EXPECT_NEAR(state.point[0], 1.0, 0.01) << state.reason;
  EXPECT_LT(state.iteration, options.iterations);
}

TEST(LeastSquares, CentralDifferencesHelpWhereOneSidedOnesMislead) {
  // With forward differences the slope at −0.002 points to −0.005, away from the minimum at 0.
  FunctionProblem problem(
      [](const VectorXd& x) { return VectorXd(Vector2d(x[0], 100.0 + x[0] * x[0])); });
  const auto state = run(LeastSquares(linear_parameters({-0.002}), {}), problem);
  EXPECT_LT(std::abs(state.point[0]), 1.5e-3) << state.reason;
}

TEST(LeastSquares, AShortStepByDampingIsNoConvergence) {
  FunctionProblem problem(rosenbrock);
  LeastSquaresOptions coarse;
  coarse.iterations = 300;
  for (const LeastSquaresOptions& options : {exact(), coarse}) {
    const LeastSquares fit(linear_parameters({-1.2, 1.0}), options);
    LeastSquaresState state = fit.start();
    state.damping = 1e13;
    while (!state.finished) fit.iterate(problem, state);
    EXPECT_TRUE(state.converged);
    EXPECT_NEAR(state.point[0], 1.0, 1e-3);
  }
}

TEST(LeastSquares, EndsAtTheLimitOfIterations) {
  FunctionProblem problem(rosenbrock);
  LeastSquaresOptions options = exact();
  options.iterations = 3;
  const auto state = run(LeastSquares(linear_parameters({-1.2, 1.0}), options), problem);
  EXPECT_EQ(state.iteration, 3);
  EXPECT_FALSE(state.converged);
  EXPECT_THAT(state.reason, HasSubstr("limit of 3"));
  options.iterations = 0;
  const auto none = run(LeastSquares(linear_parameters({-1.2, 1.0}), options), problem);
  EXPECT_EQ(none.point, VectorXd(Vector2d(-1.2, 1.0)));
  EXPECT_GT(none.cost, 0.0);
}

TEST(LeastSquares, HistoryIsALossCurve) {
  FunctionProblem problem(rosenbrock);
  const auto state = run(LeastSquares(linear_parameters({-1.2, 1.0}), exact()), problem);
  ASSERT_FALSE(state.history.empty());
  EXPECT_EQ(state.history.front().iteration, 0);
  EXPECT_DOUBLE_EQ(state.history.front().cost, 0.5 * (4.4 * 4.4 + 2.2 * 2.2));
  int accepted = 0;
  for (std::size_t i = 1; i < state.history.size(); ++i) {
    const auto& step = state.history[i];
    accepted += step.accepted ? 1 : 0;
    if (step.accepted) {
      EXPECT_LT(step.cost, state.history[i - 1].cost);
    } else {
      EXPECT_EQ(step.cost, state.history[i - 1].cost);
    }
  }
  EXPECT_EQ(accepted, state.iteration);
}

TEST(LeastSquares, LinearisesWithCentralDifferences) {
  FunctionProblem problem(
      [](const VectorXd& x) { return VectorXd(Vector2d(x[0] * x[0], x[0] * x[1])); });
  LeastSquaresOptions options;  // wide steps, whose one-sided error would show
  const LeastSquares fit(linear_parameters({2.0, 3.0}), options);
  LeastSquaresState state = fit.start();
  fit.linearise(problem, state);
  MatrixXd expected(2, 2);
  expected << 4, 0, 3, 2;
  EXPECT_LT((state.jacobian - expected).norm(), 1e-11);
  EXPECT_EQ(state.residual, VectorXd(Vector2d(4.0, 6.0)));
  EXPECT_EQ(state.evaluations, 5);
}

TEST(LeastSquares, RefusesWhatMakesNoSense) {
  const auto refused = [](std::vector<Parameter> parameters, LeastSquaresOptions options) {
    try {
      const LeastSquares fit(std::move(parameters), options);
    } catch (const Error& error) {
      return error.kind() == ErrorKind::kInput;
    }
    return false;
  };
  const auto one = linear_parameters({0.0});
  EXPECT_FALSE(refused(one, {}));
  EXPECT_TRUE(refused({}, {}));
  EXPECT_TRUE(refused(linear_parameters({5e3}), {}));
  LeastSquaresOptions options;
  options.iterations = -1;
  EXPECT_TRUE(refused(one, options));
  options = {};
  options.difference = 0.0;
  EXPECT_TRUE(refused(one, options));
  options = {};
  options.huber = -1.0;
  EXPECT_TRUE(refused(one, options));
  // A state of another fit.
  LeastSquaresState state = LeastSquares(linear_parameters({1.0, 2.0}), {}).start();
  FunctionProblem problem(rosenbrock);
  EXPECT_THROW(LeastSquares(one, {}).iterate(problem, state), Error);
}

TEST(LeastSquares, SamplesThatAreNotThereChangeNothing) {
  // What is missed is so much that the spring decides the step, by the mean square of the samples.
  const auto first_step = [](Eigen::Index rows) {
    FunctionProblem problem([&](const VectorXd& x) {
      VectorXd residual = VectorXd::Zero(rows);
      residual.head<3>() = Vector3d(1e4, 300.0 * (x[0] - 1.0), 300.0 * (x[1] + x[0]));
      return residual;
    });
    const LeastSquares fit(linear_parameters({0.0, 0.0}), exact());
    LeastSquaresState state = fit.start();
    fit.iterate(problem, state);
    return state.point;
  };
  EXPECT_LT((first_step(300) - first_step(3)).norm(), 1e-9);
}

}  // namespace
}  // namespace matterfit::fit
