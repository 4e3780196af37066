// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/autoregression.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Standard deviation of a correlation about the one that is expected.
constexpr double kMemoryDeviation = 0.3;

}  // namespace

Moments::Moments(const MatrixXd& rows, const std::vector<std::vector<Index>>& chains, double lost) {
  const Index width = rows.cols();
  Index steps = 0;
  for (const auto& chain : chains) steps += Index(chain.size()) - 1;
  MatrixXd first(Index(chains.size()), width);
  MatrixXd later(steps, width);
  MatrixXd before(steps, width);
  Index at = 0;
  for (std::size_t c = 0; c < chains.size(); ++c) {
    first.row(Index(c)) = rows.row(chains[c][0]);
    for (std::size_t j = 1; j < chains[c].size(); ++j, ++at) {
      later.row(at) = rows.row(chains[c][j]);
      before.row(at) = rows.row(chains[c][j - 1]);
    }
  }
  first_ = first.transpose() * first;
  later_ = later.transpose() * later;
  before_ = before.transpose() * before;
  const MatrixXd both = later.transpose() * before;
  cross_ = both + both.transpose();
  steps_ = double(steps);
  size_ = double(steps) + double(chains.size()) - lost;
}

Moments::Likelihood Moments::at(double phi) const {
  const double variance = 1.0 - phi * phi;
  MatrixXd gram = first_ + (later_ - phi * cross_ + phi * phi * before_) / variance;
  const Index width = gram.cols() - 1;
  Likelihood result;
  double rest = gram(width, width);
  double log_determinant = 0.0;
  double rank = 0.0;
  if (width > 0) {
    // Pivots that are nothing but rounding belong to columns that the others already span.
    const Eigen::LDLT<MatrixXd> factors(gram.topLeftCorner(width, width));
    const VectorXd pivots = factors.vectorD();
    const MatrixXd right = factors.transpositionsP() * gram.col(width).head(width);
    const MatrixXd y = factors.matrixL().solve(right);
    const double least = 1e-9 * pivots.maxCoeff();
    for (Index i = 0; i < width; ++i) {
      if (!(pivots[i] > least)) continue;
      rest -= y(i, 0) * y(i, 0) / pivots[i];
      log_determinant += std::log(pivots[i]);
      rank += 1.0;
    }
  }
  result.freedom = std::max(size_ - rank, 1.0);
  rest = std::max(rest, 1e-300);
  result.sigma = std::sqrt(rest / result.freedom);
  result.value =
      -0.5 * (result.freedom * std::log(rest) + log_determinant + steps_ * std::log(variance));
  return result;
}

Autoregression fit_autoregression(const Moments& moments, double lowest,
                                  std::optional<double> expected) {
  constexpr double kStep = 0.05;
  std::vector<double> grid;
  for (int i = 0; lowest + kStep * i < 0.96; ++i) grid.push_back(lowest + kStep * i);
  grid.push_back(kHighestCorrelation);
  std::vector<double> weight(grid.size());
  double best = -1e300;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    weight[i] = moments.at(grid[i]).value;
    if (expected) weight[i] -= 0.5 * std::pow((grid[i] - *expected) / kMemoryDeviation, 2);
    best = std::max(best, weight[i]);
  }
  double sum = 0.0;
  double mean = 0.0;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    weight[i] = std::exp(weight[i] - best);
    sum += weight[i];
    mean += weight[i] * grid[i];
  }
  Autoregression result;
  result.correlation = mean / sum;
  const Moments::Likelihood there = moments.at(result.correlation);
  result.sigma = there.sigma;
  result.freedom = there.freedom;
  for (const double share : {0.1, 0.3, 0.5, 0.7, 0.9}) {
    double passed = 0.0;
    std::size_t i = 0;
    while (i + 1 < grid.size() && passed + weight[i] < share * sum) passed += weight[i++];
    // Between the edges of the grid's cell, so that a narrow posterior is not a jump.
    const double left = i > 0 ? 0.5 * (grid[i - 1] + grid[i]) : grid[i];
    const double right = i + 1 < grid.size() ? 0.5 * (grid[i] + grid[i + 1]) : grid[i];
    const double part = (share * sum - passed) / std::max(weight[i], 1e-300);
    result.plausible.push_back(left + std::clamp(part, 0.0, 1.0) * (right - left));
  }
  return result;
}

void correct_for_constants(double frames, Autoregression& fit) {
  const auto corrected = [&](double phi) {
    return std::min(kHighestCorrelation, phi + (1.0 + 3.0 * phi) / frames);
  };
  fit.correlation = corrected(fit.correlation);
  for (double& phi : fit.plausible) phi = corrected(phi);
}

}  // namespace matterfit::diagnose
