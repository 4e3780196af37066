// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/uncertainty.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

#include "base/error.hpp"
#include "fit/numerics/test_problem.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using testing::HasSubstr;

MatrixXd random_matrix(Index rows, Index cols, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  return MatrixXd::NullaryExpr(rows, cols, [&] { return normal(engine); });
}

/// A state whose residuals have a mean square of exactly (rows − seen)/rows × noise².
LeastSquaresState state_of(const MatrixXd& jacobian, double noise = 1.0, Index seen = -1) {
  LeastSquaresState state;
  state.jacobian = jacobian;
  state.point = VectorXd::Zero(jacobian.cols());
  const double freedom = double(jacobian.rows() - (seen < 0 ? jacobian.cols() : seen));
  state.residual =
      VectorXd::Constant(jacobian.rows(), noise * std::sqrt(freedom / double(jacobian.rows())));
  return state;
}

std::vector<Parameter> parameters(std::size_t count) {
  return linear_parameters(std::vector<double>(count, 0.0));
}

TEST(Uncertainty, IsTheInverseOfTheHessian) {
  const MatrixXd jacobian = random_matrix(50, 3, 1);
  const MatrixXd covariance = (jacobian.transpose() * jacobian).inverse();
  const auto result = uncertainty(parameters(3), state_of(jacobian));
  EXPECT_NEAR(result.noise_scale, 1.0, 1e-12);
  EXPECT_TRUE(result.statements.empty());
  for (Index i = 0; i < 3; ++i) {
    const Estimate& estimate = result.estimates[std::size_t(i)];
    const double error = std::sqrt(covariance(i, i));
    EXPECT_NEAR(estimate.standard_error, error, 1e-12);
    EXPECT_NEAR(estimate.low, -1.96 * error, 1e-4 * error);
    EXPECT_NEAR(estimate.high, 1.96 * error, 1e-4 * error);
    EXPECT_TRUE(estimate.observable);
    EXPECT_FALSE(estimate.at_bound);
    EXPECT_EQ(estimate.statement, "");
    for (Index j = 0; j < 3; ++j) {
      const double expected = covariance(i, j) / std::sqrt(covariance(i, i) * covariance(j, j));
      EXPECT_NEAR(result.correlation(i, j), expected, 1e-12);
    }
  }
}

TEST(Uncertainty, ErrorsGrowWithAMisfitAndDoNotShrinkBelowTheNoise) {
  const MatrixXd jacobian = random_matrix(50, 2, 2);
  const double error = uncertainty(parameters(2), state_of(jacobian)).estimates[0].standard_error;
  const auto worse = uncertainty(parameters(2), state_of(jacobian, 3.0));
  EXPECT_NEAR(worse.noise_scale, 3.0, 1e-12);
  EXPECT_NEAR(worse.estimates[0].standard_error, 3.0 * error, 1e-12);
  ASSERT_EQ(worse.statements.size(), 1U);
  EXPECT_THAT(worse.statements[0], HasSubstr("3 times the stated noise"));
  const auto better = uncertainty(parameters(2), state_of(jacobian, 0.2));
  EXPECT_NEAR(better.noise_scale, 0.2, 1e-12);
  EXPECT_NEAR(better.estimates[0].standard_error, error, 1e-12);
  ASSERT_EQ(better.statements.size(), 1U);
  EXPECT_THAT(better.statements[0], HasSubstr("it is smaller"));
}

TEST(Uncertainty, FewerIndependentResidualsGiveLargerErrors) {
  const MatrixXd jacobian = random_matrix(4000, 2, 3);
  LeastSquaresState state = state_of(jacobian);
  state.residual.setConstant(0.9);  // not enlarged by a misfit
  const double error = uncertainty(parameters(2), state).estimates[0].standard_error;
  const auto quarter = uncertainty(parameters(2), state, 1000.0);
  EXPECT_NEAR(quarter.estimates[0].standard_error, 2.0 * error, 1e-12);
}

TEST(Uncertainty, ASmoothMisfitIsNoLackOfData) {
  const MatrixXd jacobian = random_matrix(4000, 2, 3);
  LeastSquaresState state = state_of(jacobian);
  const double error = uncertainty(parameters(2), state).estimates[0].standard_error;
  state.residual.setConstant(20.0);
  const auto smooth = uncertainty(parameters(2), state, 2.0);
  EXPECT_GE(smooth.noise_scale, 20.0);
  EXPECT_GT(smooth.estimates[0].standard_error, 20.0 * error);
  ASSERT_EQ(smooth.statements.size(), 1U);
  EXPECT_THAT(smooth.statements[0], HasSubstr("so smooth"));
}

TEST(Uncertainty, SamplesThatAreNotThereDoNotCount) {
  MatrixXd jacobian = random_matrix(60, 2, 4);
  LeastSquaresState state = state_of(jacobian.topRows(30));
  const auto expected = uncertainty(parameters(2), state);
  jacobian.bottomRows(30).setZero();
  state.jacobian = jacobian;
  state.residual.conservativeResizeLike(VectorXd::Zero(60));
  const auto found = uncertainty(parameters(2), state);
  EXPECT_NEAR(found.noise_scale, expected.noise_scale, 1e-12);
  EXPECT_NEAR(found.estimates[0].standard_error, expected.estimates[0].standard_error, 1e-12);
}

TEST(Uncertainty, WhatNothingObservesIsSaidAndSpoilsNothing) {
  MatrixXd jacobian = random_matrix(50, 3, 5);
  jacobian.col(1).setZero();
  MatrixXd others(50, 2);
  others << jacobian.col(0), jacobian.col(2);
  auto three = parameters(3);
  three[1].name = "bodies.dough.material.E";
  three[1].words = "the stiffness";
  three[1].record = "the body as it is squeezed";
  const auto expected = uncertainty(parameters(2), state_of(others));
  const auto result = uncertainty(three, state_of(jacobian, 1.0, 2));
  EXPECT_NEAR(result.estimates[0].standard_error, expected.estimates[0].standard_error, 1e-12);
  EXPECT_NEAR(result.estimates[2].standard_error, expected.estimates[1].standard_error, 1e-12);
  EXPECT_NEAR(result.correlation(0, 2), expected.correlation(0, 1), 1e-12);
  EXPECT_TRUE(result.estimates[0].observable);
  const Estimate& hidden = result.estimates[1];
  EXPECT_TRUE(std::isinf(hidden.standard_error));
  EXPECT_FALSE(hidden.observable);
  EXPECT_EQ(hidden.low, -1e3);
  EXPECT_EQ(hidden.high, 1e3);
  EXPECT_THAT(hidden.statement, HasSubstr("The stiffness (bodies.dough.material.E)"));
  EXPECT_THAT(hidden.statement, HasSubstr("not observable"));
  EXPECT_THAT(hidden.statement, HasSubstr("record the body as it is squeezed"));
  EXPECT_EQ(result.correlation.row(1), Eigen::RowVector3d(0, 1, 0));
}

TEST(Uncertainty, AnErrorAboveTheScaleIsNotObservable) {
  MatrixXd jacobian = random_matrix(50, 2, 6);
  jacobian.col(1) *= 1e-3;
  auto two = parameters(2);
  two[1].unit = "m/s";
  const auto result = uncertainty(two, state_of(jacobian));
  EXPECT_TRUE(result.estimates[0].observable);
  EXPECT_FALSE(result.estimates[1].observable);
  EXPECT_TRUE(std::isfinite(result.estimates[1].standard_error));
  EXPECT_THAT(result.estimates[1].statement, HasSubstr("not observable well"));
  EXPECT_THAT(result.estimates[1].statement, HasSubstr("m/s"));
  two[1].scale = 1e4;
  EXPECT_TRUE(uncertainty(two, state_of(jacobian)).estimates[1].observable);
}

TEST(Uncertainty, ACorrelatedPairIsSaid) {
  MatrixXd jacobian = random_matrix(200, 3, 7);
  jacobian.col(1) = jacobian.col(0) + 0.05 * jacobian.col(1);
  auto three = parameters(3);
  three[0].name = "bodies.a.material.E";
  three[1].name = "bodies.a.density";
  const auto result = uncertainty(three, state_of(jacobian));
  EXPECT_LT(result.correlation(0, 1), -0.99);
  EXPECT_LT(std::abs(result.correlation(0, 2)), 0.5);
  ASSERT_EQ(result.statements.size(), 1U);
  EXPECT_THAT(result.statements[0], HasSubstr("bodies.a.material.E and bodies.a.density"));
  EXPECT_THAT(result.statements[0], HasSubstr("raise one and lower the other"));
  jacobian.col(1) *= -1.0;
  const auto turned = uncertainty(three, state_of(jacobian));
  ASSERT_EQ(turned.statements.size(), 1U);
  EXPECT_THAT(turned.statements[0], HasSubstr("raise both"));
}

TEST(Uncertainty, OnlyACombinationObservedIsSaid) {
  MatrixXd jacobian = random_matrix(200, 4, 8);
  jacobian.col(2) = jacobian.col(0) - 2.0 * jacobian.col(3);
  const auto result = uncertainty(parameters(4), state_of(jacobian));
  for (const std::size_t k : {0U, 2U, 3U}) {
    EXPECT_TRUE(std::isinf(result.estimates[k].standard_error)) << k;
    EXPECT_FALSE(result.estimates[k].observable);
    EXPECT_THAT(result.estimates[k].statement, HasSubstr("only a combination"));
  }
  EXPECT_TRUE(result.estimates[1].observable);
  EXPECT_NEAR(result.estimates[1].standard_error, 1.0 / std::sqrt(200.0), 0.01);
  ASSERT_EQ(result.statements.size(), 1U);
  EXPECT_THAT(result.statements[0], HasSubstr("x[0], x[2] and x[3]"));
  // A prior for one of them tells them apart.
  auto known = parameters(4);
  known[3].prior = Prior{0.0, 0.1};
  EXPECT_TRUE(uncertainty(known, state_of(jacobian)).estimates[0].observable);
}

TEST(Uncertainty, AVerySmallSensitivityIsNotDependence) {
  MatrixXd jacobian = random_matrix(50, 2, 9);
  jacobian.col(1) *= 1e-9;
  auto two = parameters(2);
  two[1].scale = 1e12;
  two[1].low = -1e15;
  two[1].high = 1e15;
  const auto result = uncertainty(two, state_of(jacobian));
  EXPECT_TRUE(result.estimates[1].observable);
  EXPECT_TRUE(std::isfinite(result.estimates[1].standard_error));
}

TEST(Uncertainty, PriorsAreInformation) {
  const MatrixXd jacobian = random_matrix(30, 2, 10);
  MatrixXd hessian = jacobian.transpose() * jacobian;
  hessian(0, 0) += 100.0;
  auto two = parameters(2);
  two[0].prior = Prior{0.0, 0.1};
  const auto result = uncertainty(two, state_of(jacobian));
  const MatrixXd covariance = hessian.inverse();
  EXPECT_NEAR(result.estimates[0].standard_error, std::sqrt(covariance(0, 0)), 1e-12);
  EXPECT_NEAR(result.estimates[1].standard_error, std::sqrt(covariance(1, 1)), 1e-12);
  // 30 residuals say less than the prior, which is worth 100.
  EXPECT_FALSE(result.estimates[0].observable);
  EXPECT_THAT(result.estimates[0].statement, HasSubstr("prior"));
  two[0].prior = Prior{0.0, 1.0};
  EXPECT_TRUE(uncertainty(two, state_of(jacobian)).estimates[0].observable);
}

TEST(Uncertainty, WithAPriorErrorsAreThoseOfTheEstimate) {
  // Again and again with noise three times the stated: the values that the fit finds weigh data and
  // prior as stated.
  const MatrixXd jacobian = random_matrix(40, 1, 21);
  const double data = jacobian.squaredNorm();
  auto one = parameters(1);
  one[0].scale = 10.0;
  one[0].prior = Prior{0.0, 1.0 / std::sqrt(2.0 * data)};
  constexpr int kRepetitions = 2000;
  constexpr double kNoise = 3.0;
  std::mt19937 engine(22);
  std::normal_distribution<double> normal(0.0, 1.0);
  double squares = 0.0;
  double reported = 0.0;
  for (int k = 0; k < kRepetitions; ++k) {
    LeastSquaresState state;
    state.jacobian = jacobian;
    const double truth = one[0].prior->sigma * normal(engine);
    const VectorXd noise = kNoise * VectorXd::NullaryExpr(40, [&] { return normal(engine); });
    const double found = jacobian.col(0).dot(jacobian.col(0) * truth + noise) / (3.0 * data);
    state.point = VectorXd::Constant(1, found);
    state.residual = jacobian.col(0) * (found - truth) - noise;
    squares += std::pow(found - truth, 2.0) / kRepetitions;
    reported += std::pow(uncertainty(one, state).estimates[0].standard_error, 2.0) / kRepetitions;
  }
  EXPECT_NEAR(reported / squares, 1.0, 0.15);
}

TEST(Uncertainty, FewDegreesOfFreedomWidenAnInterval) {
  const MatrixXd jacobian = random_matrix(8, 2, 23);
  const auto over_error = [&](double noise) {
    const Estimate found = uncertainty(parameters(2), state_of(jacobian, noise)).estimates[0];
    return found.high / found.standard_error;
  };
  EXPECT_NEAR(over_error(2.0), 2.446912, 1e-5);  // Student's, six degrees of freedom
  EXPECT_NEAR(over_error(0.9), 1.959964, 1e-5);  // of the stated noise
}

TEST(Uncertainty, WhatOnlyAPriorKnowsHasItsError) {
  MatrixXd jacobian = random_matrix(30, 2, 11);
  jacobian.col(0).setZero();
  auto two = parameters(2);
  two[0].prior = Prior{0.0, 0.3};
  const auto result = uncertainty(two, state_of(jacobian, 5.0));
  EXPECT_NEAR(result.estimates[0].standard_error, 0.3, 1e-12);  // a misfit does not change it
  EXPECT_FALSE(result.estimates[0].observable);
  EXPECT_THAT(result.estimates[0].statement, HasSubstr("nothing that was compared changes"));
  EXPECT_THAT(result.estimates[0].statement, HasSubstr("that of its prior"));
}

TEST(Uncertainty, GoesThroughTheNaturalCoordinateAndStaysInBounds) {
  auto two = linear_parameters({1e5, 0.48}, 1e2, 1e10);
  two[0].coordinate = Coordinate::kLog;
  two[1].coordinate = Coordinate::kLogit;
  two[1].low = 0.01;
  two[1].high = 0.483;
  LeastSquaresState state = state_of(10.0 * MatrixXd::Identity(2, 2));
  state.residual = VectorXd::Ones(2);
  state.point << std::log(1e5), to_natural(Coordinate::kLogit, 0.48);
  const auto result = uncertainty(two, state);
  EXPECT_NEAR(result.estimates[0].value, 1e5, 1e-6);
  EXPECT_NEAR(result.estimates[0].standard_error, 1e4, 1e-6);
  EXPECT_NEAR(result.estimates[0].low, 1e5 * std::exp(-0.196), 1.0);
  EXPECT_NEAR(result.estimates[0].high, 1e5 * std::exp(0.196), 1.0);
  EXPECT_NEAR(result.estimates[1].standard_error, 0.1 * 2.0 * 0.48 * 0.02, 1e-12);
  EXPECT_LT(result.estimates[1].low, 0.48);
  EXPECT_EQ(result.estimates[1].high, 0.483);
  // As many residuals as parameters: nothing can be said of the misfit.
  EXPECT_EQ(result.noise_scale, 1.0);
  ASSERT_FALSE(result.statements.empty());
  EXPECT_THAT(result.statements.back(), HasSubstr("cannot be judged"));
}

TEST(Uncertainty, AnEndAtABoundIsSaid) {
  auto one = linear_parameters({2.0}, 0.0, 2.0);
  one[0].name = "colliders.floor.contact.mu";
  one[0].words = "the friction";
  LeastSquaresState state = state_of(random_matrix(50, 1, 12));
  state.point[0] = 2.0;
  const Estimate at = uncertainty(one, state).estimates[0];
  EXPECT_TRUE(at.at_bound);
  EXPECT_EQ(at.high, 2.0);
  EXPECT_THAT(at.statement, HasSubstr("The friction (colliders.floor.contact.mu) ended at"));
  state.point[0] = 1.9;
  EXPECT_FALSE(uncertainty(one, state).estimates[0].at_bound);
}

TEST(Uncertainty, WhatCouldNotBeExaminedIsSaid) {
  MatrixXd jacobian = random_matrix(50, 2, 13);
  jacobian.col(0).setZero();
  LeastSquaresState state = state_of(jacobian);
  state.unknown = {1, 0};
  const auto result = uncertainty(parameters(2), state);
  EXPECT_FALSE(result.estimates[0].observable);
  EXPECT_THAT(result.estimates[0].statement, HasSubstr("could not be examined"));
}

TEST(Uncertainty, RefusesAStateWithoutAJacobian) {
  LeastSquaresState state = LeastSquares(parameters(2), {}).start();
  EXPECT_THROW((void)uncertainty(parameters(2), state), Error);
}

/// Sixteen blocks of forty rows, each with a value of its own, `spread` apart, of the one
/// parameter.
LeastSquaresState state_of_blocks(double spread, unsigned seed,
                                  std::vector<std::uint32_t>& blocks) {
  constexpr Index kBlocks = 16;
  constexpr Index kRows = 40;  // each
  LeastSquaresState state;
  state.jacobian = random_matrix(kBlocks * kRows, 1, seed);
  const MatrixXd own = random_matrix(kBlocks, 1, seed + 1);
  state.residual = random_matrix(kBlocks * kRows, 1, seed + 2);
  blocks.clear();
  for (Index i = 0; i < state.residual.size(); ++i) {
    state.residual[i] -= state.jacobian(i, 0) * spread * own(i / kRows, 0);
    blocks.push_back(std::uint32_t(i / kRows));
  }
  const double step =
      state.jacobian.col(0).dot(state.residual) / state.jacobian.col(0).squaredNorm();
  state.residual -= step * state.jacobian.col(0);
  state.point = VectorXd::Constant(1, -step);
  return state;
}

TEST(Uncertainty, BlocksThatDisagreeWidenAnError) {
  constexpr double kSpread = 1.0;
  constexpr int kSeeds = 200;
  std::vector<std::uint32_t> blocks;
  double squares = 0.0;  // of the truth, 0, about the values found
  double variance = 0.0;
  double alone = 0.0;  // without the blocks
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const LeastSquaresState state = state_of_blocks(kSpread, 3 * seed, blocks);
    const auto result = uncertainty(parameters(1), state, 0.0, 0.0, blocks);
    squares += std::pow(state.point[0], 2.0) / kSeeds;
    variance += std::pow(result.estimates[0].standard_error, 2.0) / kSeeds;
    alone += std::pow(uncertainty(parameters(1), state).estimates[0].standard_error, 2.0) / kSeeds;
  }
  EXPECT_NEAR(variance / squares, 1.0, 0.3);
  EXPECT_LT(9.0 * alone, variance);
}

TEST(GridError, IsHowFarACoarserGridMovesTheValues) {
  const MatrixXd jacobian = random_matrix(50, 2, 11);
  const LeastSquaresState state = state_of(jacobian, 0.1);
  Uncertainty known = uncertainty(parameters(2), state);
  const Uncertainty before = known;
  const Vector2d moved(0.3, -0.7);  // what a fit on the coarser grid would find instead
  // Exactly so where the scales are wide.
  std::vector<Parameter> wide = parameters(2);
  for (Parameter& parameter : wide) parameter.scale = 1e4;
  add_grid_error(wide, state, -jacobian * moved, 0.5, 0.0, known);
  for (Index k = 0; k < 2; ++k) {
    const Estimate& estimate = known.estimates[std::size_t(k)];
    EXPECT_EQ(estimate.value, before.estimates[std::size_t(k)].value);
    EXPECT_EQ(estimate.standard_error, before.estimates[std::size_t(k)].standard_error);
    EXPECT_NEAR(estimate.grid_error, 0.5 * std::abs(moved[k]), 1e-6);
    const double both = std::hypot(estimate.standard_error, estimate.grid_error);
    EXPECT_NEAR(estimate.high, 1.96 * both, 1e-4 * both);
    EXPECT_NEAR(estimate.low, -1.96 * both, 1e-4 * both);
  }
  EXPECT_THAT(known.statements, testing::Contains(HasSubstr("The grid makes x[0] and x[1]")));
}

TEST(GridError, IsNotTheResidualsThatNoValueExplains) {
  MatrixXd jacobian = MatrixXd::Zero(4, 2);
  jacobian(0, 0) = 1.0;  // nothing observes the second
  const LeastSquaresState state = state_of(jacobian, 1.0, 1);
  Uncertainty known = uncertainty(parameters(2), state);
  const std::size_t statements = known.statements.size();
  add_grid_error(parameters(2), state, 5.0 * VectorXd::Unit(4, 3), 1.0, 0.0, known);
  EXPECT_EQ(known.estimates[0].grid_error, 0.0);
  EXPECT_EQ(known.estimates[1].grid_error, 0.0);
  EXPECT_EQ(known.statements.size(), statements);
  EXPECT_THROW(add_grid_error(parameters(2), state, VectorXd::Zero(3), 1.0, 0.0, known), Error);
}

TEST(GridError, LeavesOutWhatAHuberFitDoesNotSee) {
  MatrixXd jacobian = MatrixXd::Ones(3, 1);
  LeastSquaresState state = state_of(jacobian, 0.1);
  state.residual[2] = 100.0;
  Uncertainty known = uncertainty(parameters(1), state, 0.0, 2.0);
  std::vector<Parameter> wide = parameters(1);
  wide[0].scale = 1e4;
  add_grid_error(wide, state, VectorXd(Eigen::Vector3d(0.4, 0.4, 9.0)), 1.0, 2.0, known);
  EXPECT_NEAR(known.estimates[0].grid_error, 0.4, 1e-6);
}

TEST(GridError, OfAValleyIsNoMoreThanItsScale) {
  // Two values of which hardly more than the sum tells, and a change that asks for a thousand.
  MatrixXd jacobian = MatrixXd::Ones(40, 2);
  jacobian(0, 0) = 1.0 + 1e-3;
  const LeastSquaresState state = state_of(jacobian);
  Uncertainty known = uncertainty(parameters(2), state);
  VectorXd change = VectorXd::Ones(40);
  change[0] = 2.0;
  add_grid_error(parameters(2), state, change, 1.0, 0.0, known);
  EXPECT_LT(known.estimates[0].grid_error, 1.0);
  EXPECT_LT(known.estimates[1].grid_error, 1.0);
  EXPECT_NEAR(known.estimates[0].grid_error + known.estimates[1].grid_error, 1.0, 0.1);
}

TEST(Uncertainty, BlocksSayWhatTheyDisagreeAbout) {
  std::vector<std::uint32_t> blocks;
  const LeastSquaresState apart = state_of_blocks(1.0, 7, blocks);
  EXPECT_THAT(uncertainty(parameters(1), apart, 0.0, 0.0, blocks).statements,
              testing::Contains(HasSubstr("different values of x[0]")));
  const LeastSquaresState alike = state_of_blocks(0.0, 7, blocks);
  EXPECT_TRUE(uncertainty(parameters(1), alike, 0.0, 0.0, blocks).statements.empty());
}

TEST(Uncertainty, AFewBlocksTellNothing) {
  std::vector<std::uint32_t> blocks;
  const LeastSquaresState state = state_of_blocks(1.0, 7, blocks);
  for (std::uint32_t& block : blocks) block /= 8;
  EXPECT_EQ(uncertainty(parameters(1), state, 0.0, 0.0, blocks).estimates[0].standard_error,
            uncertainty(parameters(1), state).estimates[0].standard_error);
}

TEST(Uncertainty, BlocksAreOnePerResidual) {
  std::vector<std::uint32_t> blocks;
  const LeastSquaresState state = state_of_blocks(0.0, 7, blocks);
  blocks.pop_back();
  EXPECT_THROW((void)uncertainty(parameters(1), state, 0.0, 0.0, blocks), Error);
}

}  // namespace
}  // namespace matterfit::fit
