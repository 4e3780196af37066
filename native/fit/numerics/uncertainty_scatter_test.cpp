// SPDX-License-Identifier: GPL-3.0-or-later
// Standard errors and intervals against the scatter of many fits, each with noise of its own.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "fit/numerics/test_problem.hpp"
#include "fit/numerics/uncertainty.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A fit of y = A exp(−t/τ) + noise, in ln A and ln τ, again and again with fresh noise.
struct Repetitions {
  MatrixXd errors;    ///< of the estimates, natural coordinates
  VectorXd reported;  ///< mean standard error of A and τ, relative
  int covered = 0;    ///< intervals of τ in which the true one lies
  double correlation = 0.0;
};

Repetitions decays(int repetitions, double huber, double outliers) {
  constexpr double kAmplitude = 3.0;
  constexpr double kTime = 0.7;
  constexpr double kNoise = 0.05;
  constexpr int kSamples = 60;
  std::mt19937 engine(20);
  std::normal_distribution<double> normal(0.0, 1.0);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  auto two = linear_parameters({1.0, 2.0}, 1e-3, 1e3);
  for (Parameter& parameter : two) parameter.coordinate = Coordinate::kLog;
  LeastSquaresOptions options;
  options.huber = huber;
  const LeastSquares fit(two, options);
  Repetitions result{MatrixXd(repetitions, 2), VectorXd::Zero(2)};
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    VectorXd measured(kSamples);
    for (int i = 0; i < kSamples; ++i) {
      const double wild = uniform(engine) < outliers ? 20.0 : 1.0;
      measured[i] = kAmplitude * std::exp(-i / (20.0 * kTime)) + wild * kNoise * normal(engine);
    }
    FunctionProblem problem([&](const VectorXd& x) {
      VectorXd r(kSamples);
      for (int i = 0; i < kSamples; ++i) {
        r[i] = (std::exp(x[0] - i / 20.0 * std::exp(-x[1])) - measured[i]) / kNoise;
      }
      return r;
    });
    LeastSquaresState state = run(fit, problem);
    EXPECT_TRUE(state.converged) << state.reason;
    fit.linearise(problem, state);
    const auto found = uncertainty(two, state, 0.0, huber);
    result.errors(repetition, 0) = state.point[0] - std::log(kAmplitude);
    result.errors(repetition, 1) = state.point[1] - std::log(kTime);
    for (std::size_t k = 0; k < 2; ++k) {
      result.reported[Index(k)] +=
          found.estimates[k].standard_error / found.estimates[k].value / repetitions;
    }
    result.covered += found.estimates[1].low < kTime && kTime < found.estimates[1].high ? 1 : 0;
    result.correlation += found.correlation(0, 1) / repetitions;
  }
  return result;
}

TEST(Uncertainty, OfADecayIsItsScatter) {
  const int repetitions = 1000;
  const Repetitions found = decays(repetitions, 0.0, 0.0);
  const VectorXd mean = found.errors.colwise().mean();
  const MatrixXd centred = found.errors.rowwise() - mean.transpose();
  const MatrixXd covariance = centred.transpose() * centred / double(repetitions - 1);
  for (Index k = 0; k < 2; ++k) {
    const double scatter = std::sqrt(covariance(k, k));
    // The scatter of 1000 is known to 2.2 %; the errors are enlarged by noise_scale where that is
    // above 1 by chance, by about 3 % in the mean.
    EXPECT_NEAR(found.reported[k] / scatter, 1.03, 0.08) << k;
    EXPECT_LT(std::abs(mean[k]), 4.0 * scatter / std::sqrt(double(repetitions))) << k;
  }
  const double correlation = covariance(0, 1) / std::sqrt(covariance(0, 0) * covariance(1, 1));
  EXPECT_NEAR(found.correlation, correlation, 0.06);
  // 95.x %, ± 0.7 % by chance.
  EXPECT_NEAR(found.covered / double(repetitions), 0.955, 0.025);
}

TEST(Uncertainty, OfARobustFitIsItsScatter) {
  const int repetitions = 600;
  const Repetitions robust = decays(repetitions, 1.345, 0.1);
  const Repetitions plain = decays(repetitions, 0.0, 0.1);
  for (Index k = 0; k < 2; ++k) {
    const double scatter = std::sqrt(robust.errors.col(k).squaredNorm() / repetitions);
    const double wild = std::sqrt(plain.errors.col(k).squaredNorm() / repetitions);
    EXPECT_NEAR(robust.reported[k] / scatter, 1.0, 0.15) << k;
    EXPECT_LT(2.0 * scatter, wild) << k;
  }
}

}  // namespace
}  // namespace matterfit::fit
