// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "diagnose/refit.hpp"

/// How large a refit's corrections are beside what is stated of them.
namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Bounds of corrections_of().
constexpr double kLeastCorrections = 0.5;
constexpr double kMostCorrections = 8.0;

}  // namespace

VectorXd variances_of(MatrixXd information) {
  information.diagonal() *= 1.0 + 1e-9;
  information.diagonal().array() += 1e-12 * std::max(information.diagonal().maxCoeff(), 1e-300);
  const Index size = information.rows();
  return information.ldlt().solve(MatrixXd::Identity(size, size)).diagonal().cwiseMax(0.0);
}

std::vector<Index> Refitter::told_corrections(const Refit& refit) const {
  std::vector<Index> told = study_->model().corrections();
  std::erase_if(
      told, [&](Index p) { return refit.slopes.col(p).head(study_->used().size()).isZero(0.0); });
  return told;
}

double Refitter::correction_squares(const Refit& refit, const std::vector<Index>& told) const {
  double sum = 0.0;
  for (const Index p : told) {
    const double size = refit.state.theta[p] / study_->model().parameters()[std::size_t(p)].scale;
    sum += size * size;
  }
  return sum;
}

double Refitter::corrections_of(const Refit& refit) const {
  const std::vector<Index> told = told_corrections(refit);
  if (told.empty()) return 1.0;
  const MatrixXd slopes = residual_slopes(refit.slopes);
  const VectorXd variance = variances_of(slopes.transpose() * slopes);
  const double sum = correction_squares(refit, told) + variance(told).sum();
  return std::clamp(std::sqrt(sum / double(told.size())), kLeastCorrections, kMostCorrections);
}

double Refitter::own_corrections(const Refit& refit) const {
  const double own = corrections_of(refit);
  const std::vector<Index> told = told_corrections(refit);
  const double count = double(told.size());
  return correction_squares(refit, told) *
             (1.0 / (own * own) - 1.0 / (corrections_ * corrections_)) +
         2.0 * count * std::log(own / corrections_);
}

}  // namespace matterfit::diagnose
