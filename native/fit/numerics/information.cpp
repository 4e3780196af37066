// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/information.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "base/error.hpp"
#include "fit/numerics/student.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// A noise scale above this enlarges errors: 1, but for rounding.
constexpr double kEnlarges = 1.0 + 1e-9;
/// Variance by which others multiply a parameter's, above which only a combination is observed.
constexpr double kDependent = 1e10;
constexpr double kTakesPart = 0.1;      // component of a direction worth a name
constexpr double kDisagree = 2.0;       // blocks' error over the noise's
constexpr std::size_t kMoreBlocks = 4;  // than parameters

/// What the residuals and their Jacobian hold.
struct Observed {
  MatrixXd data;         ///< JᵀJ, with Huber's estimator its counterpart
  double noise = 1.0;    ///< √(χ²/degrees of freedom)
  bool judged = true;    ///< there are degrees of freedom
  bool smooth = false;   ///< what is missed is so smooth that none are left
  double slope = 1.0;    ///< mean of ψ′: with Huber's estimator the part that lies inside
  double weight = 1.0;   ///< independent residuals, as a part of all
  double freedom = 1.0;  ///< independent residuals less parameters that they know, at least 1
};

Observed observed_by(const LeastSquaresState& state, std::size_t parameters, double effective,
                     double huber) {
  const MatrixXd& jacobian = state.jacobian;
  const Index n = jacobian.cols();
  Observed result;
  result.data.resize(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j <= i; ++j) {
      result.data(i, j) = result.data(j, i) = jacobian.col(i).dot(jacobian.col(j));
    }
  }
  double observed = 0.0;
  double linear = 0.0;
  double squares = 0.0;
  for (Index i = 0; i < state.residual.size(); ++i) {
    const double size = std::abs(state.residual[i]);
    if (!is_observed(state, i)) continue;
    observed += 1.0;
    const bool outside = huber > 0.0 && size > huber;
    if (outside) linear += 1.0;
    squares += outside ? huber * huber : size * size;
  }
  const double independent = effective > 0.0 ? std::min(effective, observed) : observed;
  std::size_t free = 0;
  for (std::size_t k = 0; k < parameters; ++k)
    free += result.data(Index(k), Index(k)) > 0.0 ? 1 : 0;
  // Residuals that hang together over the whole capture are a misfit, not a lack of data.
  const double left = independent - double(free);
  result.smooth = left < 1.0;
  result.freedom = std::max(1.0, left);
  result.judged = observed - double(free) >= 1.0 && linear < observed;
  if (observed > 0.0) result.weight = independent / observed;
  if (!result.judged) return result;
  result.slope = 1.0 - linear / observed;
  result.noise = std::sqrt(squares / observed * (independent / result.freedom)) / result.slope;
  return result;
}

/// Natural coordinates.
struct Covariance {
  VectorXd error;
  MatrixXd correlation;
  std::vector<std::vector<Index>> unseen;  ///< who takes part in each direction nothing observes
};

Covariance invert(const MatrixXd& hessian) {
  const Index n = hessian.rows();
  Covariance result{VectorXd::Constant(n, kInfinite), MatrixXd::Identity(n, n), {}};
  std::vector<Index> seen;
  for (Index k = 0; k < n; ++k) {
    if (hessian(k, k) > 0.0) seen.push_back(k);
  }
  if (seen.empty()) return result;
  // With a unit diagonal a small eigenvalue means dependence, not a small sensitivity.
  const VectorXd root = hessian.diagonal()(seen).cwiseSqrt();
  const MatrixXd normal = root.cwiseInverse().asDiagonal() * MatrixXd(hessian(seen, seen)) *
                          root.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(normal);
  const VectorXd values = eigen.eigenvalues().cwiseMax(1e-3 / kDependent);
  const MatrixXd& vectors = eigen.eigenvectors();
  const MatrixXd inverse = vectors * values.cwiseInverse().asDiagonal() * vectors.transpose();
  for (std::size_t a = 0; a < seen.size(); ++a) {
    const auto i = Index(a);
    const double inflation = inverse(i, i);
    if (inflation < kDependent) result.error[seen[a]] = std::sqrt(inflation) / root[i];
    for (std::size_t b = 0; b < seen.size(); ++b) {
      const auto j = Index(b);
      if (i == j) continue;
      result.correlation(seen[a], seen[b]) =
          std::clamp(inverse(i, j) / std::sqrt(inflation * inverse(j, j)), -1.0, 1.0);
    }
  }
  for (Index v = 0; v < values.size(); ++v) {
    if (eigen.eigenvalues()[v] * kDependent > 1.0) break;  // ascending
    std::vector<Index> members;
    for (std::size_t a = 0; a < seen.size(); ++a) {
      if (std::abs(vectors(Index(a), v)) > kTakesPart) members.push_back(seen[a]);
    }
    result.unseen.push_back(std::move(members));
  }
  return result;
}

/// The covariance of natural coordinates times a vector; 0 where nothing is observed.
VectorXd product(const Covariance& covariance, const VectorXd& vector) {
  VectorXd result = VectorXd::Zero(vector.size());
  for (Index k = 0; k < vector.size(); ++k) {
    if (!std::isfinite(covariance.error[k])) continue;
    for (Index j = 0; j < vector.size(); ++j) {
      if (!std::isfinite(covariance.error[j])) continue;
      result[k] +=
          covariance.correlation(k, j) * covariance.error[k] * covariance.error[j] * vector[j];
    }
  }
  return result;
}

/// The inverse of a Hessian; rows and columns of what nothing observes are 0.
MatrixXd matrix_of(const Covariance& covariance) {
  const Index n = covariance.error.size();
  MatrixXd result(n, n);
  for (Index k = 0; k < n; ++k) result.col(k) = product(covariance, VectorXd::Unit(n, k));
  return result;
}

/// H⁻¹ M H⁻¹ in place of H⁻¹: of the values at which a function with the Hessian H is least, where
/// its gradient scatters by M.
Covariance sandwich(Covariance inverse, const MatrixXd& middle) {
  const MatrixXd bread = matrix_of(inverse);
  const MatrixXd covariance = bread * middle * bread;
  const auto seen = [&](Index k) { return std::isfinite(inverse.error[k]); };
  for (Index k = 0; k < covariance.cols(); ++k) {
    if (seen(k)) inverse.error[k] = std::sqrt(std::max(0.0, covariance(k, k)));
  }
  for (Index k = 0; k < covariance.cols(); ++k) {
    for (Index j = 0; j < covariance.cols(); ++j) {
      const double both = inverse.error[k] * inverse.error[j];
      if (j == k || !seen(k) || !seen(j) || !(both > 0.0)) continue;
      inverse.correlation(k, j) = std::clamp(covariance(k, j) / both, -1.0, 1.0);
    }
  }
  return inverse;
}

/// Errors from how far the blocks disagree; 0 where they cannot tell. `hessian` and `weights` (of
/// the priors) are those that the fit itself made small. `freedom`: blocks less parameters.
VectorXd between_blocks(const LeastSquaresState& state, const MatrixXd& hessian,
                        const VectorXd& weights, double huber,
                        const std::vector<std::uint32_t>& blocks, double& freedom) {
  const Index n = hessian.cols();
  VectorXd errors = VectorXd::Zero(n);
  std::map<std::uint32_t, VectorXd> gradients;
  for (Index i = 0; i < state.residual.size(); ++i) {
    if (state.jacobian.row(i).isZero(0.0)) continue;
    VectorXd& gradient =
        gradients.try_emplace(blocks[std::size_t(i)], VectorXd::Zero(n)).first->second;
    const double r = state.residual[i];
    gradient +=
        (huber > 0.0 ? std::clamp(r, -huber, huber) : r) * state.jacobian.row(i).transpose();
  }
  if (gradients.size() < std::size_t(n) + kMoreBlocks) return errors;
  const double count = double(gradients.size());
  freedom = count - double(n);
  VectorXd mean = VectorXd::Zero(n);  // not 0 at a bound
  for (const auto& [block, gradient] : gradients) mean += gradient / count;
  MatrixXd middle = weights.asDiagonal();
  for (const auto& [block, gradient] : gradients) {
    middle += count / (count - double(n)) * (gradient - mean) * (gradient - mean).transpose();
  }
  const Covariance inverse = invert(hessian);
  for (Index k = 0; k < n; ++k) {
    const VectorXd row = product(inverse, VectorXd::Unit(n, k));
    errors[k] = std::sqrt(std::max(0.0, row.dot(middle * row)));
  }
  return errors;
}

VectorXd prior_weights(const std::vector<Parameter>& parameters) {
  VectorXd weights = VectorXd::Zero(Index(parameters.size()));
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const auto& prior = parameters[k].prior;
    if (prior) weights[Index(k)] = 1.0 / (prior->sigma * prior->sigma);
  }
  return weights;
}

}  // namespace

Information information(const std::vector<Parameter>& parameters, const LeastSquaresState& state,
                        double effective, double huber, const std::vector<std::uint32_t>& blocks) {
  const auto n = Index(parameters.size());
  if (state.point.size() != n || state.jacobian.cols() != n ||
      state.jacobian.rows() != state.residual.size() ||
      (!blocks.empty() && Index(blocks.size()) != state.residual.size())) {
    throw_input("the uncertainty of a fit needs its point, its residuals and its Jacobian.");
  }
  const Observed data = observed_by(state, parameters.size(), effective, huber);
  const double enlarged = std::max(1.0, data.noise);
  const VectorXd weights = prior_weights(parameters);
  const auto with_priors = [&](double weight) {
    MatrixXd hessian = weight * data.data;
    hessian.diagonal() += weights;
    return hessian;
  };
  const double known = data.weight / (enlarged * enlarged);
  // What the data and the priors know; of values that were found with another weight, which only
  // matters where there are priors, more is wrong.
  const Covariance narrowed = invert(with_priors(known));
  Covariance covariance =
      weights.isZero(0.0)
          ? narrowed
          : sandwich(invert(with_priors(data.slope)), with_priors(data.slope * data.slope / known));

  Information result;
  result.noise_scale = data.noise;
  result.judged = data.judged;
  result.smooth = data.smooth;
  for (Index k = 0; k < n; ++k) result.sensitive.push_back(data.data(k, k) > 0.0);
  result.narrowed = narrowed.error;
  result.quantile = VectorXd::Constant(
      n, data.judged && data.noise > kEnlarges ? student_quantile(data.freedom) : kNormalQuantile);
  result.error = covariance.error;
  if (!blocks.empty() && data.judged) {
    double freedom = 0.0;
    const VectorXd between =
        between_blocks(state, with_priors(data.slope), weights, huber, blocks, freedom);
    for (Index k = 0; k < n; ++k) {
      if (between[k] > kDisagree * result.error[k]) result.disagreed.push_back(k);
      if (!(between[k] > result.error[k])) continue;
      result.error[k] = between[k];
      result.quantile[k] = student_quantile(freedom);
    }
  }
  result.correlation = std::move(covariance.correlation);
  result.unseen = std::move(covariance.unseen);
  return result;
}

VectorXd grid_shift(const std::vector<Parameter>& parameters, const LeastSquaresState& state,
                    const VectorXd& change, double share, double huber) {
  const auto n = Index(parameters.size());
  if (change.size() != state.residual.size() || state.jacobian.rows() != change.size() ||
      state.jacobian.cols() != n) {
    throw_input("the grid error of a fit needs its Jacobian and as many residuals.");
  }
  MatrixXd hessian = MatrixXd::Zero(n, n);
  VectorXd gradient = VectorXd::Zero(n);
  double observed = 0.0;
  double squares = 0.0;
  for (Index i = 0; i < change.size(); ++i) {
    if (huber > 0.0 && std::abs(state.residual[i]) > huber) continue;
    if (change[i] == 0.0 && state.jacobian.row(i).isZero(0.0)) continue;
    const VectorXd row = state.jacobian.row(i);
    hessian += row * row.transpose();
    gradient += change[i] * row;
    observed += 1.0;
    squares += change[i] * change[i];
  }
  if (!(squares > 0.0)) return VectorXd::Zero(n);
  const double weight = observed / squares;
  hessian *= weight;
  for (Index k = 0; k < n; ++k) {
    const Parameter& parameter = parameters[std::size_t(k)];
    const double scale =
        parameter.prior ? std::min(parameter.prior->sigma, parameter.scale) : parameter.scale;
    hessian(k, k) += 1.0 / (scale * scale);
  }
  return share * weight * product(invert(hessian), gradient);
}

}  // namespace matterfit::fit
