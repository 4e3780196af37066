// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/excited.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Smaller eigenvalues of a matrix with a unit diagonal count as this much.
constexpr double kLeastEigenvalue = 1e-13;

/// The diagonal of the inverse of a Hessian without zeros on its own.
VectorXd variances(const MatrixXd& hessian) {
  const VectorXd scale = hessian.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scale.asDiagonal() * hessian *
                                                      scale.asDiagonal());
  const VectorXd inverse = eigen.eigenvalues().cwiseMax(kLeastEigenvalue).cwiseInverse();
  const MatrixXd squares = eigen.eigenvectors().cwiseAbs2();
  return (squares * inverse).cwiseProduct(scale.cwiseAbs2());
}

}  // namespace

std::vector<std::size_t> excited(const std::vector<Parameter>& parameters, const MatrixXd& jacobian,
                                 std::size_t first) {
  const std::size_t count = parameters.size();
  const auto lacks_prior = [](const Parameter& parameter) { return !parameter.prior; };
  if (jacobian.cols() != Index(count) || first > count ||
      std::any_of(parameters.begin() + Index(first), parameters.end(), lacks_prior)) {
    throw_input("what data excite needs a column of the Jacobian for each parameter, and priors.");
  }
  MatrixXd hessian = jacobian.transpose() * jacobian;
  for (std::size_t k = 0; k < count; ++k) {
    const auto& prior = parameters[k].prior;
    if (prior) hessian(Index(k), Index(k)) += 1.0 / (prior->sigma * prior->sigma);
  }
  std::vector<Index> kept;
  for (Index k = 0; k < Index(count); ++k) {
    if (hessian(k, k) > 0.0) kept.push_back(k);
  }
  for (;;) {
    if (kept.empty()) return {};
    const VectorXd variance = variances(hessian(kept, kept));
    std::size_t worst = kept.size();
    double largest = 1.0 / std::numbers::sqrt2;
    for (std::size_t a = 0; a < kept.size(); ++a) {
      if (kept[a] < Index(first)) continue;
      const double share =
          std::sqrt(variance[Index(a)]) / parameters[std::size_t(kept[a])].prior->sigma;
      if (!(share > largest)) continue;
      largest = share;
      worst = a;
    }
    if (worst == kept.size()) break;
    kept.erase(kept.begin() + Index(worst));
  }
  std::vector<std::size_t> result;
  for (const Index k : kept) {
    if (k >= Index(first)) result.push_back(std::size_t(k));
  }
  return result;
}

}  // namespace matterfit::fit
