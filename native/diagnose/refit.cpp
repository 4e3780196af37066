// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/refit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error.hpp"
#include "fit/numerics/bounded_step.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFirstDamping = 1e-4;
constexpr double kMostDamping = 1e6;

/// [θ | α] in scales.
VectorXd scales_of(const Model& model, const State& state) {
  std::vector<double> scales;
  for (const fit::Parameter& parameter : model.parameters()) scales.push_back(parameter.scale);
  for (const Active& cause : state.causes) {
    for (const Number& number : model.effects()[std::size_t(cause.effect)].numbers) {
      scales.push_back(number.scale);
    }
  }
  return Eigen::Map<const VectorXd>(scales.data(), Index(scales.size()));
}

/// Where [θ | α] may lie: natural coordinates and physical values.
fit::Box box_of(const Model& model, const State& state) {
  std::vector<double> low;
  std::vector<double> high;
  for (const fit::Parameter& parameter : model.parameters()) {
    low.push_back(fit::to_natural(parameter.coordinate, parameter.low));
    high.push_back(fit::to_natural(parameter.coordinate, parameter.high));
  }
  for (const Active& cause : state.causes) {
    for (const Number& number : model.effects()[std::size_t(cause.effect)].numbers) {
      low.push_back(number.one_sided ? std::max(number.neutral, number.low) : number.low);
      high.push_back(number.high);
    }
  }
  return {Eigen::Map<const VectorXd>(low.data(), Index(low.size())),
          Eigen::Map<const VectorXd>(high.data(), Index(high.size()))};
}

VectorXd values_of(const State& state) {
  Index count = state.theta.size();
  for (const Active& cause : state.causes) count += cause.values.size();
  VectorXd values(count);
  values.head(state.theta.size()) = state.theta;
  Index at = state.theta.size();
  for (const Active& cause : state.causes) {
    values.segment(at, cause.values.size()) = cause.values;
    at += cause.values.size();
  }
  return values;
}

State with_values(State state, const VectorXd& values) {
  state.theta = values.head(state.theta.size());
  Index at = state.theta.size();
  for (Active& cause : state.causes) {
    cause.values = values.segment(at, cause.values.size());
    at += cause.values.size();
  }
  return state;
}

VectorXd bias_columns(const Study& study, const Spread& spread) {
  return spread.bias.size() == study.size() ? VectorXd(-spread.bias) : VectorXd();
}

MatrixXd spread_columns(const Study& study, const Spread& spread) {
  const Index members = spread.members.cols();
  if (members == 0) return MatrixXd(study.used().size(), 0);
  return spread.members.topRows(study.used().size()) / std::sqrt(double(members));
}

}  // namespace

ThetaPrior theta_prior(const Model& model) {
  const auto& parameters = model.parameters();
  ThetaPrior prior{VectorXd::Zero(Index(parameters.size())),
                   VectorXd::Zero(Index(parameters.size()))};
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    if (!parameters[p].prior) continue;
    const double sigma = parameters[p].prior->sigma / parameters[p].scale;
    prior.precision[Index(p)] = 1.0 / (sigma * sigma);
    prior.mean[Index(p)] = parameters[p].prior->mean;
  }
  return prior;
}

/// A point of the search: values, and what the data and priors say there.
struct Refitter::Place {
  State state;
  double bias = 0.0;
  VectorXd prediction;  ///< stacked, with bias
  VectorXd residual;    ///< whitened, then prior rows: (θ − θ₀)/σ of each, bias
  double chi_square = 0.0;
};

Refitter::Refitter(const Study& study, const Noise& noise, const Spread& spread,
                   RefitOptions options)
    : study_(&study),
      options_(options),
      whitening_(study.used(), noise, spread_columns(study, spread)),
      bias_(bias_columns(study, spread)) {}

Refitter::Place Refitter::place(const State& state, double bias, const VectorXd& seen) const {
  const Model& model = study_->model();
  const Index used = study_->used().size();
  const Index p = state.theta.size();
  Place result{state, bias, seen, {}, 0.0};
  if (bias_.size() > 0) result.prediction += bias * bias_;
  const VectorXd white = whitening_.apply((study_->measured() - result.prediction).head(used));
  result.chi_square = white.squaredNorm();
  const ThetaPrior prior = theta_prior(model);
  result.residual.resize(used + p + 1);
  result.residual.head(used) = white;
  for (Index i = 0; i < p; ++i) {
    const double scale = model.parameters()[std::size_t(i)].scale;
    result.residual[used + i] =
        std::sqrt(prior.precision[i]) * (state.theta[i] - prior.mean[i]) / scale;
  }
  result.residual[used + p] = bias_.size() > 0 ? (bias - kBiasMean) / kBiasSigma : 0.0;
  return result;
}

MatrixXd Refitter::slopes_at(const State& state) const {
  const Linearised lin = linearise(*study_, state, {}, options_.differences);
  MatrixXd slopes(study_->size(), lin.theta.cols() + lin.active.cols());
  slopes << lin.theta, lin.active;
  return slopes;
}

/// Derivatives of Place::residual by [θ | α | bias], in scales.
MatrixXd Refitter::residual_slopes(const MatrixXd& slopes) const {
  const Index used = study_->used().size();
  const Index p = Index(study_->model().parameters().size());
  const bool biased = bias_.size() > 0;
  const Index numbers = slopes.cols();
  MatrixXd columns(used, numbers + (biased ? 1 : 0));
  columns.leftCols(numbers) = slopes.topRows(used);
  if (biased) columns.col(numbers) = bias_.head(used);
  MatrixXd result = MatrixXd::Zero(used + p + 1, columns.cols());
  result.topRows(used) = -whitening_.apply(columns);
  const ThetaPrior prior = theta_prior(study_->model());
  for (Index i = 0; i < p; ++i) result(used + i, i) = std::sqrt(prior.precision[i]);
  if (biased) result(used + p, numbers) = 1.0 / kBiasSigma;
  return result;
}

namespace {

/// Takes the causes of a state to `share` of what they are beyond their neutral values.
void shrink(const Model& model, double share, State& state) {
  if (share == 1.0) return;
  for (Active& cause : state.causes) {
    const std::vector<Number>& numbers = model.effects()[std::size_t(cause.effect)].numbers;
    for (Index k = 0; k < cause.values.size(); ++k) {
      const double neutral = numbers[std::size_t(k)].neutral;
      cause.values[k] = neutral + share * (cause.values[k] - neutral);
    }
  }
}

}  // namespace

Refit Refitter::fit(const std::vector<State>& starts, MatrixXd slopes) const {
  const Model& model = study_->model();
  const double bias_start = bias_.size() > 0 ? kBiasMean : 0.0;
  std::optional<Place> here;
  // A first estimate is linear: where what it says cannot be simulated, less of it may be.
  for (const double share : {1.0, 0.1, 0.01, 0.0}) {
    std::vector<State> closer = starts;
    for (State& state : closer) shrink(model, share, state);
    const auto seen = study_->predict(closer);
    for (std::size_t i = 0; i < closer.size(); ++i) {
      if (!seen[i]) continue;
      Place there = place(closer[i], bias_start, *seen[i]);
      if (!here || there.residual.squaredNorm() < here->residual.squaredNorm()) {
        here = std::move(there);
      }
    }
    if (here) break;
  }
  if (!here) throw_compute("No start of a refit could be simulated.");

  const VectorXd scales = scales_of(model, here->state);
  const fit::Box bounds = box_of(model, here->state);
  const Index numbers = scales.size();
  MatrixXd jacobian =
      residual_slopes(slopes.size() == 0 ? slopes_at(here->state) : std::move(slopes));
  bool fresh = true;
  bool trusted = false;
  Refit result;
  double damping = kFirstDamping;
  for (int accepted = 0; accepted < options_.iterations;) {
    const VectorXd values = values_of(here->state);
    fit::Box box{VectorXd::Constant(jacobian.cols(), -1e6),
                 VectorXd::Constant(jacobian.cols(), 1e6)};
    box.low.head(numbers) =
        (bounds.low - values).cwiseQuotient(scales).cwiseMin(0.0).cwiseMax(-1e6);
    box.high.head(numbers) =
        (bounds.high - values).cwiseQuotient(scales).cwiseMax(0.0).cwiseMin(1e6);
    const MatrixXd hessian = jacobian.transpose() * jacobian;
    MatrixXd damped = hessian;
    damped.diagonal() +=
        damping * hessian.diagonal() +
        VectorXd::Constant(hessian.cols(), 1e-12 * hessian.diagonal().maxCoeff() + 1e-300);
    const VectorXd gradient = jacobian.transpose() * here->residual;
    const VectorXd step = fit::bounded_step(damped, gradient, box);
    const double promised = -(2.0 * gradient.dot(step) + step.dot(hessian * step));
    if (!(promised > options_.tolerance)) {
      // Slopes that were never tried since they were made, or kept their last promise, are
      // believed.
      if (fresh || trusted) {
        result.converged = damping <= 1.0;
        break;
      }
      jacobian = residual_slopes(slopes_at(here->state));
      fresh = true;
      damping = kFirstDamping;
      continue;
    }
    const State next = with_values(here->state, (values + scales.cwiseProduct(step.head(numbers)))
                                                    .cwiseMax(bounds.low)
                                                    .cwiseMin(bounds.high));
    const double next_bias = here->bias + (bias_.size() > 0 ? step[numbers] : 0.0);
    const auto run = study_->predict({next})[0];
    std::optional<Place> there;
    if (run) there = place(next, next_bias, *run);
    const double gained =
        there ? here->residual.squaredNorm() - there->residual.squaredNorm() : -1.0;
    if (!(gained > 0.0)) {
      if (!fresh) {
        jacobian = residual_slopes(slopes_at(here->state));
        fresh = true;
      } else {
        damping = std::max(10.0 * damping, 1e-2);
        if (damping > kMostDamping) break;
      }
      continue;
    }
    const double length = step.squaredNorm();
    const VectorXd surprise = there->residual - here->residual - jacobian * step;
    jacobian += surprise * step.transpose() / length;
    fresh = false;
    trusted = gained > 0.5 * promised && gained < 1.5 * promised;
    here = std::move(there);
    ++accepted;
    damping = gained > 0.5 * promised ? std::max(0.1 * damping, 1e-8) : damping * 3.0;
    if (gained < 0.25 * promised) {
      jacobian = residual_slopes(slopes_at(here->state));
      fresh = true;
    }
  }

  result.state = here->state;
  result.bias = here->bias;
  result.chi_square = here->chi_square;
  result.deviance = here->residual.squaredNorm();
  result.freedom = std::max(1.0, double(study_->used().size() - numbers));
  result.prediction = here->prediction;
  MatrixXd hessian = jacobian.transpose() * jacobian;
  hessian.diagonal() *= 1.0 + 1e-12;
  const MatrixXd covariance =
      hessian.ldlt().solve(MatrixXd::Identity(hessian.cols(), hessian.cols()));
  const Index p = result.state.theta.size();
  result.error = covariance.diagonal()
                     .segment(p, numbers - p)
                     .cwiseMax(0.0)
                     .cwiseSqrt()
                     .cwiseProduct(scales.tail(numbers - p));
  Index at = 0;
  for (const Active& cause : result.state.causes) {
    const Effect& effect = model.effects()[std::size_t(cause.effect)];
    for (std::size_t k = 0; k < effect.numbers.size(); ++k, ++at) {
      const double value = cause.values[Index(k)];
      const double margin = 1e-6 * effect.numbers[k].scale;
      if (value >= effect.numbers[k].high - margin || value <= effect.numbers[k].low + margin) {
        // A one-sided number whose bound is the neutral value is simply not there.
        result.at_bound = result.at_bound || value != effect.numbers[k].neutral;
      }
    }
  }
  return result;
}

}  // namespace matterfit::diagnose
