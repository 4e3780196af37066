// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/test_problem.hpp"

namespace matterfit::fit {
namespace {

constexpr Eigen::Index kSize = 8;
constexpr Eigen::Index kResiduals = 3 * kSize;

/// Curved residuals that no point makes 0, with their exact Jacobian.
class CurvedProblem : public FunctionProblem {
 public:
  explicit CurvedProblem(bool has_adjoint)
      : FunctionProblem(residuals), has_adjoint_(has_adjoint) {}

  static std::optional<Eigen::VectorXd> residuals(const Eigen::VectorXd& x) {
    Eigen::VectorXd r(kResiduals);
    for (Eigen::Index k = 0; k < kSize; ++k) {
      const double y = x[(k + 1) % kSize];
      r[3 * k] = std::exp(x[k]) - 2.0 + 0.3 * y;
      r[3 * k + 1] = std::sin(x[k] + 0.5 * y) + 1.5;
      r[3 * k + 2] = 0.4 * x[k] * x[k] - y;
    }
    return r;
  }
  static Eigen::VectorXd gradient(const Eigen::VectorXd& x, const Eigen::VectorXd& w) {
    Eigen::VectorXd g = Eigen::VectorXd::Zero(kSize);
    for (Eigen::Index k = 0; k < kSize; ++k) {
      const Eigen::Index next = (k + 1) % kSize;
      const double slope = std::cos(x[k] + 0.5 * x[next]);
      g[k] += w[3 * k] * std::exp(x[k]) + w[3 * k + 1] * slope + w[3 * k + 2] * 0.8 * x[k];
      g[next] += 0.3 * w[3 * k] + 0.5 * w[3 * k + 1] * slope - w[3 * k + 2];
    }
    return g;
  }

  std::optional<Eigen::VectorXd> transposed(const Eigen::VectorXd& point,
                                            const Eigen::VectorXd& weights) override {
    ++asked;
    if (fails) return std::nullopt;
    return factor * gradient(point, weights);
  }
  [[nodiscard]] double transposed_cost() const override { return has_adjoint_ ? 4.0 : 0.0; }

  int asked = 0;
  bool fails = false;
  double factor = 1.0;

 private:
  bool has_adjoint_;
};

std::vector<Parameter> adjoint_parameters() {
  return linear_parameters(std::vector<double>(std::size_t(kSize), 1.5), -10.0, 10.0);
}

/// Differences so wide that one-sided ones lead nowhere at last.
LeastSquaresOptions wide() {
  LeastSquaresOptions options = exact();
  options.difference = 0.3;
  options.cost_tolerance = 1e-9;
  options.step_tolerance = 1e-6;
  return options;
}

double steepest(const LeastSquaresState& state, double huber = 0.0) {
  Eigen::VectorXd weights = state.residual;
  if (huber > 0.0) weights = weights.cwiseMax(-huber).cwiseMin(huber);
  return CurvedProblem::gradient(state.point, weights).norm();
}

TEST(LeastSquaresAdjoint, EndsWhereTheExactGradientVanishes) {
  for (const double huber : {0.0, 1.2}) {
    LeastSquaresOptions options = wide();
    options.huber = huber;
    const LeastSquares fit(adjoint_parameters(), options);
    CurvedProblem with(true);
    const LeastSquaresState state = run(fit, with);
    EXPECT_GT(with.asked, 0);
    EXPECT_LT(steepest(state, huber), 1e-4);
    CurvedProblem without(false);
    const LeastSquaresState central = run(fit, without);
    EXPECT_EQ(without.asked, 0);
    EXPECT_LT(with.evaluations + 4 * with.asked, without.evaluations);
    EXPECT_NEAR(state.cost, central.cost, 1e-6 * central.cost);
  }
}

TEST(LeastSquaresAdjoint, WhereItFailsCentralDifferencesTakeItsPlace) {
  const LeastSquares fit(adjoint_parameters(), wide());
  CurvedProblem without(false);
  CurvedProblem with(true);
  with.fails = true;
  EXPECT_EQ(run(fit, with).point, run(fit, without).point);
  EXPECT_GT(with.asked, 0);
}

TEST(LeastSquaresAdjoint, AWrongOneDoesNotEndTheSearch) {
  CurvedProblem right(true);
  const LeastSquares fit(adjoint_parameters(), wide());
  const double least = run(fit, right).cost;
  for (const double factor : {-1.0, 1e20, std::numeric_limits<double>::quiet_NaN()}) {
    CurvedProblem wrong(true);
    wrong.factor = factor;
    const LeastSquaresState state = run(fit, wrong);
    EXPECT_NEAR(state.cost, least, 1e-6 * least) << factor;
    EXPECT_LE(wrong.asked, 3) << factor;
  }
}

TEST(LeastSquaresAdjoint, GoesOnToTheSameBits) {
  bool fresh = false;
  bool kept = false;
  for (int i = 0; i < 20; ++i) {
    std::vector<double> start(std::size_t(kSize), 0.0);
    for (int k = 0; k < int(kSize); ++k) {
      start[std::size_t(k)] = 3.0 * std::sin(1.7 * i + 2.3 * k);
    }
    const LeastSquares fit(linear_parameters(start, -10.0, 10.0), wide());
    CurvedProblem problem(true);
    const LeastSquaresState expected = run(fit, problem);
    LeastSquaresState state = fit.start();
    while (!state.finished) {
      state.jacobian.resize(0, 0);
      state.unknown.clear();
      fit.iterate(problem, state);
      for (const int at : state.corrected) (at == 0 ? fresh : kept) = true;
    }
    EXPECT_EQ(state.point, expected.point);
    EXPECT_EQ(state.cost, expected.cost);
    EXPECT_EQ(state.evaluations, expected.evaluations);
    EXPECT_EQ(state.jacobian, expected.jacobian);
  }
  EXPECT_TRUE(fresh);
  EXPECT_TRUE(kept);
}

TEST(LeastSquaresAdjoint, ACorrectedJacobianIsNotWhatErrorsAreTakenFrom) {
  const LeastSquares fit(adjoint_parameters(), exact());
  CurvedProblem problem(true);
  CurvedProblem cheaper(true);
  problem.cheaper = &cheaper;
  LeastSquaresState state = fit.start();
  state.point.setConstant(0.1);
  state.residual = *CurvedProblem::residuals(state.point);
  state.anchor = state.point;
  state.corrected = {0};
  state.jacobian = Eigen::MatrixXd::Constant(kResiduals, kSize, 1e3);
  state.unknown.assign(std::size_t(kSize), 0);
  fit.linearise(problem, state);
  EXPECT_LT(state.jacobian.cwiseAbs().maxCoeff(), 10.0);
}

}  // namespace
}  // namespace matterfit::fit
