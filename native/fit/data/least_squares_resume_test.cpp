// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "base/error.hpp"
#include "fit/data/cloud_residuals.hpp"
#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/test_problem.hpp"

namespace matterfit::fit {
namespace {

void expect_same(const LeastSquaresState& a, const LeastSquaresState& b) {
  EXPECT_EQ(a.point, b.point);
  EXPECT_EQ(a.residual, b.residual);
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(a.damping, b.damping);
  EXPECT_EQ(a.iteration, b.iteration);
  EXPECT_EQ(a.jacobian, b.jacobian);
  EXPECT_EQ(a.reason, b.reason);
  ASSERT_EQ(a.history.size(), b.history.size());
  for (std::size_t i = 0; i < a.history.size(); ++i) {
    EXPECT_EQ(a.history[i].cost, b.history[i].cost);
    EXPECT_EQ(a.history[i].damping, b.history[i].damping);
  }
}

/// What goes through a file: all but the Jacobian, which each iteration makes anew.
LeastSquaresState reloaded(const LeastSquaresState& state) {
  LeastSquaresState copy = state;
  copy.jacobian.resize(0, 0);
  copy.unknown.clear();
  return copy;
}

TEST(LeastSquaresResume, GoesOnToTheSameBits) {
  const auto parameters = linear_parameters({-1.2, 1.0});
  FunctionProblem problem(rosenbrock);
  const auto expected = run(LeastSquares(parameters, exact()), problem);
  LeastSquaresState state = LeastSquares(parameters, exact()).start();
  while (!state.finished) {
    state = reloaded(state);
    LeastSquares(parameters, exact()).iterate(problem, state);
  }
  expect_same(state, expected);
  EXPECT_EQ(state.evaluations, expected.evaluations);
}

TEST(LeastSquaresResume, CancelledAnywhereGoesOnToTheSameBits) {
  const LeastSquares fit(linear_parameters({-1.2, 1.0}), exact());
  FunctionProblem undisturbed(rosenbrock);
  const auto expected = run(fit, undisturbed);
  for (int at = 0; at < undisturbed.batches; ++at) {
    FunctionProblem problem(rosenbrock);
    problem.last_batch = at;
    LeastSquaresState state = fit.start();
    LeastSquaresState before = state;
    bool cancelled = false;
    while (!state.finished) {
      before = state;
      try {
        fit.iterate(problem, state);
      } catch (const Error& error) {
        EXPECT_EQ(error.kind(), ErrorKind::kCancelled);
        EXPECT_EQ(state.point, before.point);
        EXPECT_EQ(state.history.size(), before.history.size());
        cancelled = true;
        problem.last_batch = std::numeric_limits<int>::max();
      }
    }
    EXPECT_TRUE(cancelled);
    expect_same(state, expected);
  }
}

TEST(LeastSquaresResume, GoesOnFromCentralSlopesToTheSameBits) {
  const LeastSquaresOptions options = exact();
  const double h = options.difference;
  const auto curved = [](const Eigen::VectorXd& x) {
    return Eigen::VectorXd(Eigen::Vector3d(x[0] + 0.3 * std::sin(x[0]) - 2.0 + 0.2 * x[1],
                                           std::exp(0.3 * x[1]) - 1.5 + 0.1 * x[0] * x[0],
                                           0.1 * x[0] * x[1]));
  };
  // Beside the start both sides are off by as much: one-sided slopes lead the wrong way, where
  // nothing can be simulated, and two-sided ones are right.
  FunctionProblem problem([&](const Eigen::VectorXd& x) -> std::optional<Eigen::VectorXd> {
    const bool beside = x[1] == 0.0 && std::abs(std::abs(x[0]) - h) < 1e-3 * h;
    if (!beside) return x[0] < 0.0 ? std::nullopt : std::optional(curved(x));
    return Eigen::VectorXd(curved(x) - 2.0 * h * Eigen::Vector3d(1.3, 0.0, 0.0));
  });
  const LeastSquares fit(linear_parameters({0.0, 0.0}, -5.0, 5.0), options);
  LeastSquaresState state = fit.start();
  fit.iterate(problem, state);
  EXPECT_TRUE(state.central);
  ASSERT_GT(state.anchor.size(), 0);
  ASSERT_FALSE(state.finished);
  while (!state.finished) {
    state = reloaded(state);
    fit.iterate(problem, state);
  }
  EXPECT_GT(state.iteration, 3);
  expect_same(state, run(fit, problem));
}

TEST(LeastSquaresResume, SameForAnyThreads) {
  // Where a cloud lies, from another sample of it.
  std::mt19937 engine(1);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const auto cloud = [&](double shift) {
    Points points(1000);
    for (Vec3d& x : points) {
      // One statement each: compilers call the arguments of a function in orders of their own.
      x.x() = shift + uniform(engine);
      x.y() = uniform(engine) - shift;
      x.z() = 0.3 * uniform(engine);
    }
    return points;
  };
  const Points simulated = cloud(0.0);
  const Points captured = cloud(0.2);
  std::vector<LeastSquaresState> states;
  for (const int threads : {1, 2}) {
    Arena arena(threads);
    const CloudScale scale = cloud_scale(captured, 0.01, arena);
    const Points means = cloud_means(captured, scale, arena);
    FunctionProblem problem([&](const Eigen::VectorXd& x) {
      Points moved = simulated;
      for (Vec3d& y : moved) y += Vec3d(x[0], x[1], x[2]);
      return cloud_residuals(moved, captured, means, scale, arena);
    });
    states.push_back(run(LeastSquares(linear_parameters({0.0, 0.0, 0.0}), {}), problem));
    expect_same(states.back(), states.front());
  }
  // To half the points' spacing.
  EXPECT_LT((states[0].point - Eigen::Vector3d(0.2, -0.2, 0.0)).norm(), 0.033);
}

}  // namespace
}  // namespace matterfit::fit
