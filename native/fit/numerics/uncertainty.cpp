// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/uncertainty.hpp"

#include <fmt/format.h>

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
constexpr double kStrong = 0.95;  // correlation worth a statement
/// A noise scale above this enlarges errors: 1, but for rounding.
constexpr double kEnlarges = 1.0 + 1e-9;
/// Variance by which others multiply a parameter's, above which only a combination is observed.
constexpr double kDependent = 1e10;
constexpr double kTakesPart = 0.1;      // component of a direction worth a name
constexpr double kMisfit = 2.0;         // noise scale worth a statement
constexpr double kDisagree = 2.0;       // blocks' error over the noise's, worth a statement
constexpr std::size_t kMoreBlocks = 4;  // than parameters

struct Information {
  MatrixXd data;         ///< JᵀJ, with Huber's estimator its counterpart
  double noise = 1.0;    ///< √(χ²/degrees of freedom)
  bool judged = true;    ///< there are degrees of freedom
  bool smooth = false;   ///< what is missed is so smooth that none are left
  double slope = 1.0;    ///< mean of ψ′: with Huber's estimator the part that lies inside
  double weight = 1.0;   ///< independent residuals, as a part of all
  double freedom = 1.0;  ///< independent residuals less parameters that they know, at least 1
};

Information information(const LeastSquaresState& state, std::size_t parameters, double effective,
                        double huber) {
  const MatrixXd& jacobian = state.jacobian;
  const Index n = jacobian.cols();
  Information result;
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

/// Sets the interval from the error in natural coordinates.
void set_interval(const Parameter& parameter, double at, double error, Estimate& estimate) {
  const double half = estimate.quantile * error;
  estimate.low = value_within_bounds(parameter, at - half);
  estimate.high = value_within_bounds(parameter, at + half);
}

VectorXd prior_weights(const std::vector<Parameter>& parameters) {
  VectorXd weights = VectorXd::Zero(Index(parameters.size()));
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const auto& prior = parameters[k].prior;
    if (prior) weights[Index(k)] = 1.0 / (prior->sigma * prior->sigma);
  }
  return weights;
}

std::string capital(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = char(text[0] - 'a' + 'A');
  return text;
}

std::string listed(const std::vector<Parameter>& parameters, const std::vector<Index>& members) {
  std::string text;
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (i > 0) text += i + 1 == members.size() ? " and " : ", ";
    text += parameters[std::size_t(members[i])].name;
  }
  return text;
}

/// How well a value is known that is not known well.
std::string range(const Parameter& parameter, const Estimate& estimate) {
  const std::string unit = parameter.unit.empty() ? "" : " " + parameter.unit;
  return fmt::format("between {:.3g} and {:.3g}{} (95 %)", estimate.low, estimate.high, unit);
}

std::string statement_of(const Parameter& parameter, const Estimate& estimate, bool sensitive,
                         bool unknown, bool far) {
  const std::string see =
      far ? " That holds where the search ended, which is far from the capture: if it is a wrong "
            "place, begin from other values. Else record " +
                parameter.record + "."
          : " To see it, record " + parameter.record + ".";
  const std::string subject = capital(parameter.words) + " (" + parameter.name + ")";
  if (unknown) {
    return subject +
           " could not be examined: the simulation could not be completed for values beside it.";
  }
  const std::string prior = parameter.prior ? " Its value is that of its prior." : "";
  if (!sensitive) {
    return subject + " is not observable: nothing that was compared changes with it." + prior + see;
  }
  if (!estimate.observable) {
    if (parameter.prior) {
      return subject +
             " is hardly observable: the data say less about it than its prior does; it "
             "lies " +
             range(parameter, estimate) + "." + see;
    }
    if (std::isinf(estimate.standard_error)) {
      return subject +
             " is not observable by itself: only a combination with other parameters is. "
             "Fix one of them, give it a prior, or record " +
             parameter.record + ".";
    }
    return subject + " is not observable well: it lies " + range(parameter, estimate) +
           ", and within that the simulation changes by no more than the noise." + see;
  }
  if (estimate.at_bound) {
    return subject + fmt::format(
                         " ended at its bound {:.4g}. Widen the bounds if a value beyond is "
                         "possible; otherwise something else in the scene is wrong.",
                         estimate.value);
  }
  return "";
}

std::vector<std::string> general(const std::vector<Parameter>& parameters,
                                 const Covariance& covariance, const Information& data) {
  std::vector<std::string> statements;
  const auto n = Index(parameters.size());
  MatrixXd told = MatrixXd::Zero(n, n);
  for (const std::vector<Index>& members : covariance.unseen) {
    statements.push_back("Only a combination of " + listed(parameters, members) +
                         " is observed. Fix one of them or give it a prior.");
    for (const Index a : members) {
      for (const Index b : members) told(a, b) = 1.0;
    }
  }
  for (Index i = 0; i < n; ++i) {
    for (Index j = i + 1; j < n; ++j) {
      const double c = covariance.correlation(i, j);
      if (std::abs(c) < kStrong || told(i, j) != 0.0) continue;
      statements.push_back(fmt::format(
          "{} and {} are hard to tell apart (correlation {:.3f}): {}, and little changes. Fix one "
          "of them or give it a prior.",
          parameters[std::size_t(i)].name, parameters[std::size_t(j)].name, c,
          c > 0.0 ? "raise both" : "raise one and lower the other"));
    }
  }
  if (!data.judged) {
    statements.emplace_back(
        "There are not more independent observations than parameters: how well the law fits cannot "
        "be judged, and errors are those of the stated noise.");
  } else if (data.noise > kMisfit) {
    statements.push_back(fmt::format(
        "The simulation misses the capture by {:.3g} times the stated noise: the law or "
        "the scene lacks something, or the noise is larger. Errors are enlarged by it{}.",
        data.noise,
        data.smooth ? ", and rough: what is missed is so smooth that it is hardly more than one "
                      "observation for each parameter"
                    : ""));
  } else if (data.noise < 1.0 / kMisfit) {
    statements.push_back(fmt::format(
        "The simulation meets the capture to {:.3g} of the noise that is counted (of clouds the "
        "spacing of their points is counted too): it is smaller, and the errors may be too.",
        data.noise));
  }
  return statements;
}

}  // namespace

Uncertainty uncertainty(const std::vector<Parameter>& parameters, const LeastSquaresState& state,
                        double effective, double huber, const std::vector<std::uint32_t>& blocks,
                        bool far) {
  const auto n = Index(parameters.size());
  if (state.point.size() != n || state.jacobian.cols() != n ||
      state.jacobian.rows() != state.residual.size() ||
      (!blocks.empty() && Index(blocks.size()) != state.residual.size())) {
    throw_input("the uncertainty of a fit needs its point, its residuals and its Jacobian.");
  }
  const Information data = information(state, parameters.size(), effective, huber);
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
  const Covariance covariance =
      weights.isZero(0.0)
          ? narrowed
          : sandwich(invert(with_priors(data.slope)), with_priors(data.slope * data.slope / known));
  VectorXd errors = covariance.error;
  VectorXd quantiles = VectorXd::Constant(
      n, data.judged && data.noise > kEnlarges ? student_quantile(data.freedom) : kNormalQuantile);
  std::vector<Index> disagreed;
  if (!blocks.empty() && data.judged) {
    double freedom = 0.0;
    const VectorXd between =
        between_blocks(state, with_priors(data.slope), weights, huber, blocks, freedom);
    for (Index k = 0; k < n; ++k) {
      if (between[k] > kDisagree * errors[k]) disagreed.push_back(k);
      if (!(between[k] > errors[k])) continue;
      errors[k] = between[k];
      quantiles[k] = student_quantile(freedom);
    }
  }

  Uncertainty result;
  result.correlation = covariance.correlation;
  result.noise_scale = data.noise;
  for (Index k = 0; k < n; ++k) {
    const Parameter& parameter = parameters[std::size_t(k)];
    const double at = state.point[k];
    const double error = errors[k];
    Estimate estimate;
    estimate.value = value_within_bounds(parameter, at);
    estimate.standard_error = error * derivative(parameter.coordinate, at);
    estimate.quantile = quantiles[k];
    set_interval(parameter, at, error, estimate);
    const double near = 1e-6 * parameter.scale;
    estimate.at_bound = at - to_natural(parameter.coordinate, parameter.low) <= near ||
                        to_natural(parameter.coordinate, parameter.high) - at <= near;
    const double expected =
        parameter.prior ? parameter.prior->sigma / std::sqrt(2.0) : parameter.scale;
    estimate.observable = narrowed.error[k] < expected;
    const bool unknown =
        std::size_t(k) < state.unknown.size() && state.unknown[std::size_t(k)] != 0;
    estimate.statement = statement_of(parameter, estimate, data.data(k, k) > 0.0, unknown, far);
    result.estimates.push_back(std::move(estimate));
  }
  result.statements = general(parameters, covariance, data);
  if (!disagreed.empty()) {
    result.statements.push_back(
        "Parts of the capture ask for different values of " + listed(parameters, disagreed) +
        ", by more than the noise explains: the law or the scene lacks something. Errors are "
        "enlarged by it.");
  }
  return result;
}

void add_grid_error(const std::vector<Parameter>& parameters, const LeastSquaresState& state,
                    const VectorXd& change, double share, double huber, Uncertainty& known) {
  const auto n = Index(parameters.size());
  if (change.size() != state.residual.size() || state.jacobian.rows() != change.size() ||
      state.jacobian.cols() != n || known.estimates.size() != parameters.size()) {
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
  if (!(squares > 0.0)) return;
  const double weight = observed / squares;
  hessian *= weight;
  for (Index k = 0; k < n; ++k) {
    const Parameter& parameter = parameters[std::size_t(k)];
    const double scale =
        parameter.prior ? std::min(parameter.prior->sigma, parameter.scale) : parameter.scale;
    hessian(k, k) += 1.0 / (scale * scale);
  }
  const VectorXd shift = share * weight * product(invert(hessian), gradient);
  std::vector<Index> uncertain;
  for (Index k = 0; k < n; ++k) {
    Estimate& estimate = known.estimates[std::size_t(k)];
    if (!std::isfinite(estimate.standard_error)) continue;
    const Parameter& parameter = parameters[std::size_t(k)];
    const double slope = derivative(parameter.coordinate, state.point[k]);
    const double error = estimate.standard_error / slope;
    estimate.grid_error = std::abs(shift[k]) * slope;
    set_interval(parameter, state.point[k], std::hypot(error, shift[k]), estimate);
    if (std::abs(shift[k]) > error) uncertain.push_back(k);
  }
  if (uncertain.empty()) return;
  known.statements.push_back(
      "The grid makes " + listed(parameters, uncertain) +
      " less certain than the data do: on a coarser grid other values would fit best. Use a "
      "smaller particle separation to know more.");
}

}  // namespace matterfit::fit
