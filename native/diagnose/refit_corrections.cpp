// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Cholesky>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "diagnose/refit.hpp"

/// How large a refit's corrections are beside what is stated of them.
namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Sizes of corrections that are compared: half of what is stated to eight times that.
constexpr double kLeastCorrections = 0.5;
constexpr double kMostCorrections = 8.0;
constexpr int kSizes = 25;

}  // namespace

MatrixXd regularised(MatrixXd information) {
  information.diagonal() *= 1.0 + 1e-9;
  information.diagonal().array() += 1e-12 * std::max(information.diagonal().maxCoeff(), 1e-300);
  return information;
}

VectorXd variances_of(MatrixXd information) {
  const Index size = information.rows();
  const Eigen::LDLT<MatrixXd> factors(regularised(std::move(information)));
  return factors.solve(MatrixXd::Identity(size, size)).diagonal().cwiseMax(0.0);
}

Refitter::Corrections Refitter::corrections_of(const Refit& refit) const {
  const Index used = study_->used().size();
  std::vector<Index> told = study_->model().corrections();
  std::erase_if(told, [&](Index p) { return refit.slopes.col(p).head(used).isZero(0.0); });
  if (told.empty()) return {};
  const VectorXd white = whitening_.apply((study_->measured() - refit.prediction).head(used));
  const VectorXd residual = with_priors(white, refit.state, refit.bias, refit.corrections);
  const MatrixXd slopes = residual_slopes(refit.slopes, refit.state, refit.corrections);
  const MatrixXd hessian = slopes.transpose() * slopes;
  const VectorXd gradient = slopes.transpose() * residual;
  const VectorXd stated = theta_prior(study_->model()).precision;
  // −2 ln of the evidence at a size, but for what is the same at all; and without what the model
  // has to gain there.
  struct Evidence {
    double whole = 0.0;
    double width = 0.0;
  };
  const auto evidence_at = [&](double size) {
    const double change = 1.0 / (size * size) - 1.0 / (refit.corrections * refit.corrections);
    MatrixXd h = hessian;
    VectorXd g = gradient;
    double deviance = residual.squaredNorm();
    for (const Index k : told) {
      const double x = refit.state.theta[k] / study_->model().parameters()[std::size_t(k)].scale;
      h(k, k) += change * stated[k];
      g[k] += change * stated[k] * x;
      deviance += change * stated[k] * x * x;
    }
    const Eigen::LDLT<MatrixXd> factors(regularised(std::move(h)));
    const double width = factors.vectorD().array().abs().max(1e-300).log().sum() +
                         2.0 * double(told.size()) * std::log(size);
    return Evidence{deviance - g.dot(factors.solve(g)) + width, width};
  };
  Corrections best;
  std::optional<double> least;
  for (int i = 0; i < kSizes; ++i) {
    const double size = kLeastCorrections * std::pow(kMostCorrections / kLeastCorrections,
                                                     double(i) / double(kSizes - 1));
    const double evidence = evidence_at(size).whole;
    if (least && !(evidence < *least)) continue;
    least = evidence;
    best.size = size;
  }
  best.term = *least - evidence_at(corrections_).width - residual.squaredNorm();
  return best;
}

}  // namespace matterfit::diagnose
