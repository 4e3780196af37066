// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/refit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "diagnose/state_box.hpp"
#include "fit/numerics/bounded_step.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFirstDamping = 1e-4;
constexpr double kMostDamping = 1e6;

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

}  // namespace

/// A point of the search: values, and what the data and priors say there.
struct Refitter::Place {
  State state;
  double bias = 0.0;
  VectorXd prediction;  ///< stacked, with bias
  VectorXd residual;  ///< whitened, then prior rows: (θ − θ₀)/σ of each, bias, α/σ of each
  double chi_square = 0.0;
};

Refitter::Refitter(const Study& study, const Noise& noise, const Spread& spread,
                   RefitOptions options)
    : study_(&study),
      options_(std::move(options)),
      corrections_(noise.corrections),
      whitening_(
          study.used(), noise,
          solver_columns(study.used(), study.model().captures(), spread.top(study.used().size()))
              .values),
      bias_(bias_columns(study, spread)) {}

Refitter::Place Refitter::place(const State& state, double bias, const VectorXd& seen,
                                double corrections) const {
  const Index used = study_->used().size();
  Place result{state, bias, seen, {}, 0.0};
  if (bias_.size() > 0) result.prediction += bias * bias_;
  const VectorXd white = whitening_.apply((study_->measured() - result.prediction).head(used));
  result.chi_square = white.squaredNorm();
  result.residual = with_priors(white, state, bias, corrections);
  return result;
}

VectorXd Refitter::with_priors(const VectorXd& white, const State& state, double bias,
                               double corrections) const {
  const ThetaPrior prior = theta_prior(study_->model(), corrections);
  const Index p = state.theta.size();
  const CausePriors causes = cause_priors(study_->model(), state);
  VectorXd result(white.size() + p + 1 + causes.precision.size());
  result.head(white.size()) = white;
  result.tail(causes.precision.size()) = causes.precision.cwiseSqrt().cwiseProduct(causes.beyond);
  for (Index i = 0; i < p; ++i) {
    const double scale = study_->model().parameters()[std::size_t(i)].scale;
    result[white.size() + i] =
        std::sqrt(prior.precision[i]) * (state.theta[i] - prior.mean[i]) / scale;
  }
  result[white.size() + p] = bias_.size() > 0 ? (bias - kBiasMean) / kBiasSigma : 0.0;
  return result;
}

MatrixXd Refitter::slopes_at(const State& state, const MatrixXd& known) const {
  DifferenceOptions differences = options_.differences;
  // Each step is tried: what a one-sided derivative errs by costs a step at most, the other side
  // one run a number.
  differences.central = false;
  differences.wanted = Study::Wanted::kUsed;
  const Linearised lin = linearise_keeping(*study_, state, {}, differences, known);
  MatrixXd slopes(study_->size(), lin.theta.cols() + lin.active.cols());
  slopes << lin.theta, lin.active;
  return slopes;
}

MatrixXd Refitter::residual_slopes(const MatrixXd& slopes, const State& state,
                                   double corrections) const {
  const VectorXd precision = theta_prior(study_->model(), corrections).precision;
  const Index used = study_->used().size();
  const Index p = Index(study_->model().parameters().size());
  const bool biased = bias_.size() > 0;
  const Index numbers = slopes.cols();
  MatrixXd columns(used, numbers + (biased ? 1 : 0));
  columns.leftCols(numbers) = slopes.topRows(used);
  if (biased) columns.col(numbers) = bias_.head(used);
  const VectorXd known = cause_priors(study_->model(), state).precision;
  MatrixXd result = MatrixXd::Zero(used + p + 1 + known.size(), columns.cols());
  result.topRows(used) = -whitening_.apply(columns);
  for (Index i = 0; i < p; ++i) result(used + i, i) = std::sqrt(precision[i]);
  if (biased) result(used + p, numbers) = 1.0 / kBiasSigma;
  for (Index k = 0; k < known.size(); ++k) {
    result(used + p + 1 + k, p + k) = std::sqrt(known[k]);
  }
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

/// One search, which says what it wants simulated next.
class Refitter::Search {
 public:
  Search(const Refitter& refitter, RefitStart start)
      : refitter_(refitter),
        start_(std::move(start)),
        corrections_(start_.corrections > 0.0 ? start_.corrections : refitter.corrections_),
        slopes_(std::move(start_.slopes)),
        made_(slopes_) {}

  /// Nothing more: the search has ended.
  [[nodiscard]] std::vector<State> wanted() {
    std::vector<State> states;
    if (!here_) {
      if (share_ < kShares.size()) states = closer();
    } else if (!ended_ && accepted_ < refitter_.options_.iterations) {
      states = next_step();
    }
    ended_ = states.empty();
    return states;
  }

  void take(std::span<const std::optional<VectorXd>> seen) {
    if (here_) {
      take_step(seen.front());
    } else {
      take_start(seen);
    }
  }

  [[nodiscard]] bool ended() const { return ended_; }
  /// The state that the search has come to; null where no start could be simulated.
  [[nodiscard]] const State* end() const { return here_ ? &here_->state : nullptr; }
  /// `seen`: what a simulation at end() shows of all rows.
  [[nodiscard]] std::optional<Refit> result(const std::optional<VectorXd>& seen) const;

 private:
  /// A first estimate is linear: where what it says cannot be simulated, less of it may be.
  static constexpr std::array<double, 4> kShares = {1.0, 0.1, 0.01, 0.0};
  /// Promises that are worth new slopes, over what ends the search.
  static constexpr double kWorthSlopes = 40.0;
  /// Share of the deviance at which slopes were made, below which they are of another place.
  static constexpr double kFarFromStart = 0.7;

  [[nodiscard]] const Model& model() const { return refitter_.study_->model(); }
  /// Slopes of which a renewal keeps some; no columns: none.
  [[nodiscard]] MatrixXd known() const { return start_.whole ? MatrixXd() : made_; }
  [[nodiscard]] bool biased() const { return refitter_.bias_.size() > 0; }

  /// Derivatives of the residual by the present slopes; all states have the same causes.
  [[nodiscard]] MatrixXd residual_slopes() const {
    return refitter_.residual_slopes(slopes_, start_.states.front(), corrections_);
  }

  [[nodiscard]] std::vector<State> closer() {
    trying_ = start_.states;
    for (State& state : trying_) shrink(model(), kShares[share_], state);
    return trying_;
  }

  void take_start(std::span<const std::optional<VectorXd>> seen) {
    ++share_;
    const auto left = left_once_adapted();
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < trying_.size(); ++i) {
      if (!seen[i]) continue;
      Place there = refitter_.place(trying_[i], biased() ? kBiasMean : 0.0, *seen[i], corrections_);
      const double deviance = left(there.residual);
      if (here_ && !(deviance < least)) continue;
      least = deviance;
      began_ = i;
      here_ = std::move(there);
    }
    if (!here_) return;
    renewed_at_ = here_->residual.squaredNorm();
    const bool moved = start_.made_there && began_ > 0;
    if (moved) start_.whole = false;
    made_here_ = start_.made_there && !moved;
    scales_ = scales_of(model(), here_->state);
    bounds_ = box_of(model(), here_->state);
    if (slopes_.cols() != scales_.size() || start_.renew || moved) {
      slopes_ = made_ = refitter_.slopes_at(here_->state, known());
      made_here_ = true;
    }
    jacobian_ = residual_slopes();
  }

  /// The deviance of a residual once nuisances of known times have adapted to first order, where
  /// there are slopes: at the base they have made up for what a cause at a set value then does a
  /// second time.
  [[nodiscard]] std::function<double(const VectorXd&)> left_once_adapted() const {
    const std::vector<Index> adapting = nuisances_of_times(model());
    if (trying_.size() < 2 || adapting.empty() || slopes_.cols() == 0) {
      return [](const VectorXd& residual) { return residual.squaredNorm(); };
    }
    const MatrixXd columns = residual_slopes()(Eigen::all, adapting);
    MatrixXd h = columns.transpose() * columns;
    h.diagonal() *= 1.0 + 1e-9;
    h.diagonal().array() += 1e-300;
    return [columns, factors = Eigen::LDLT<MatrixXd>(h)](const VectorXd& residual) {
      const VectorXd gradient = columns.transpose() * residual;
      return residual.squaredNorm() - gradient.dot(factors.solve(gradient));
    };
  }

  /// Whether there was a renewal left. A search that is far off gains much by each. Slopes that
  /// were made here would only be made again.
  bool renew() {
    if (fresh_) return false;
    if (made_here_) {
      slopes_ = made_;
      jacobian_ = residual_slopes();
      return false;
    }
    const RefitOptions& options = refitter_.options_;
    const double now = here_->residual.squaredNorm();
    if (now > (1.0 - options.worth) * renewed_at_ &&
        renewed_++ >= options.renewals + start_.renewals) {
      return false;
    }
    renewed_at_ = now;
    slopes_ = made_ = refitter_.slopes_at(here_->state, known());
    jacobian_ = residual_slopes();
    fresh_ = true;
    made_here_ = true;
    return true;
  }

  void solve_step() {
    const VectorXd values = values_of(here_->state);
    const Index numbers = scales_.size();
    fit::Box box{VectorXd::Constant(jacobian_.cols(), -1e6),
                 VectorXd::Constant(jacobian_.cols(), 1e6)};
    const fit::Box room = room_about(values, bounds_, scales_);
    box.low.head(numbers) = room.low;
    box.high.head(numbers) = room.high;
    const MatrixXd hessian = jacobian_.transpose() * jacobian_;
    MatrixXd damped = hessian;
    damped.diagonal() +=
        damping_ * hessian.diagonal() +
        VectorXd::Constant(hessian.cols(), 1e-12 * hessian.diagonal().maxCoeff() + 1e-300);
    const VectorXd gradient = jacobian_.transpose() * here_->residual;
    step_ = fit::bounded_step(damped, gradient, box);
    promised_ = -(2.0 * gradient.dot(step_) + step_.dot(hessian * step_));
    next_ = with_values(here_->state, (values + scales_.cwiseProduct(step_.head(numbers)))
                                          .cwiseMax(bounds_.low)
                                          .cwiseMin(bounds_.high));
  }

  /// A promise that ends the search.
  [[nodiscard]] double enough() const {
    constexpr double kOnTheWay = 0.01;
    // Impacts make a deviance rough: below a unit nothing is gained.
    constexpr double kRoughness = 1.0;
    const RefitOptions& options = refitter_.options_;
    const double least = model().corrections().empty() ? options.tolerance : kRoughness;
    const double share = start_.rough ? kOnTheWay : options.share;
    return std::max(least, share * here_->residual.squaredNorm());
  }

  [[nodiscard]] std::vector<State> next_step() {
    solve_step();
    if (!(promised_ > enough())) {
      // Slopes that were never tried since they were made, or kept their last promise not far from
      // there, are believed.
      const bool far = here_->residual.squaredNorm() < kFarFromStart * renewed_at_;
      if (!start_.rough && !fresh_ && (far || !trusted_) && renew()) {
        damping_ = kFirstDamping;
        return next_step();
      }
      converged_ = damping_ <= 1.0;
      return {};
    }
    return damping_ > kMostDamping ? std::vector<State>{} : std::vector<State>{next_};
  }

  void take_step(const std::optional<VectorXd>& seen) {
    const double next_bias = here_->bias + (biased() ? step_[scales_.size()] : 0.0);
    std::optional<Place> there;
    if (seen) there = refitter_.place(next_, next_bias, *seen, corrections_);
    const double gained =
        there ? here_->residual.squaredNorm() - there->residual.squaredNorm() : -1.0;
    if (there) learn(*there);
    if (!(gained > 0.0)) {
      if (promised_ < kWorthSlopes * enough() || !renew()) {
        damping_ = std::max(10.0 * damping_, 1e-2);
      }
      return;
    }
    trusted_ = gained > 0.5 * promised_ && gained < 1.5 * promised_;
    here_ = std::move(there);
    made_here_ = false;
    ++accepted_;
    damping_ = gained > 0.5 * promised_ ? std::max(0.1 * damping_, 1e-8) : damping_ * 3.0;
    if (gained < 0.25 * promised_ && promised_ > kWorthSlopes * enough()) (void)renew();
  }

  /// Broyden's rule, row by row, so that it holds for whitened rows and others alike.
  void learn(const Place& there) {
    const Index numbers = scales_.size();
    const VectorXd moved = step_.head(numbers);
    const double length = moved.squaredNorm();
    if (!(length > 0.0)) return;
    VectorXd surprise = there.prediction - here_->prediction - slopes_ * moved;
    if (biased()) surprise -= (there.bias - here_->bias) * refitter_.bias_;
    slopes_ += surprise * moved.transpose() / length;
    jacobian_ = residual_slopes();
    fresh_ = false;
  }

  const Refitter& refitter_;
  RefitStart start_;
  double corrections_;
  std::vector<State> trying_;
  std::size_t began_ = 0;  ///< of them
  std::size_t share_ = 0;
  std::optional<Place> here_;
  MatrixXd slopes_;
  MatrixXd made_;  ///< by differences, before steps brought them up to date
  MatrixXd jacobian_;
  VectorXd scales_;
  fit::Box bounds_;
  VectorXd step_;
  State next_;
  double promised_ = 0.0;
  double damping_ = kFirstDamping;
  bool fresh_ = true;
  bool made_here_ = false;  ///< `made_` is of the present place
  bool trusted_ = false;
  bool converged_ = false;
  bool ended_ = false;
  int accepted_ = 0;
  int renewed_ = 0;          ///< in vain
  double renewed_at_ = 0.0;  ///< deviance there; at first of the start
};

std::optional<Refit> Refitter::Search::result(const std::optional<VectorXd>& seen) const {
  if (!here_ || !seen) return std::nullopt;
  const Index numbers = scales_.size();
  Refit result;
  result.converged = converged_;
  result.began = began_;
  result.corrections = corrections_;
  result.state = here_->state;
  result.bias = here_->bias;
  result.chi_square = here_->chi_square;
  result.deviance = here_->residual.squaredNorm();
  result.freedom = std::max(1.0, double(refitter_.study_->used().size() - numbers));
  result.prediction = *seen;
  if (biased()) result.prediction += here_->bias * refitter_.bias_;
  result.slopes = slopes_;
  MatrixXd hessian = jacobian_.transpose() * jacobian_;
  hessian.diagonal() *= 1.0 + 1e-12;
  const MatrixXd covariance =
      hessian.ldlt().solve(MatrixXd::Identity(hessian.cols(), hessian.cols()));
  const Index p = result.state.theta.size();
  result.error.resize(numbers - p);
  for (Index k = p; k < numbers; ++k) {
    // A number that moves nothing, or that others make up for, is not known at all.
    const bool known = hessian(k, k) > 0.0 && covariance(k, k) > 0.0;
    result.error[k - p] =
        known ? scales_[k] * std::sqrt(covariance(k, k)) : std::numeric_limits<double>::infinity();
  }
  for (const Active& cause : result.state.causes) {
    const Effect& effect = model().effects()[std::size_t(cause.effect)];
    for (std::size_t k = 0; k < effect.numbers.size(); ++k) {
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

std::vector<std::optional<Refit>> Refitter::fit_all(std::vector<RefitStart> starts) const {
  std::vector<Search> searches;
  searches.reserve(starts.size());
  for (RefitStart& start : starts) searches.emplace_back(*this, std::move(start));
  while (true) {
    std::vector<State> states;
    std::vector<std::size_t> first(searches.size() + 1, 0);
    for (std::size_t i = 0; i < searches.size(); ++i) {
      // A search that has begun may end anywhere.
      const bool ends = spent() && searches[i].end();
      if (ends && !searches[i].ended()) study_->mark_cut();
      const std::vector<State> wanted = ends ? std::vector<State>() : searches[i].wanted();
      states.insert(states.end(), wanted.begin(), wanted.end());
      first[i + 1] = states.size();
    }
    if (states.empty()) break;
    const auto seen = study_->predict(states, Study::Wanted::kUsed);
    for (std::size_t i = 0; i < searches.size(); ++i) {
      if (first[i + 1] > first[i]) {
        searches[i].take(std::span(seen).subspan(first[i], first[i + 1] - first[i]));
      }
    }
  }
  std::vector<std::optional<Refit>> results;
  results.reserve(searches.size());
  std::vector<State> ends;
  for (const Search& search : searches) {
    if (search.end()) ends.push_back(*search.end());
  }
  const auto seen = study_->predict(ends);
  std::size_t next = 0;
  for (const Search& search : searches) {
    results.push_back(search.end() ? search.result(seen[next++]) : std::nullopt);
  }
  return results;
}

Refit Refitter::fit(RefitStart start) const {
  std::vector<RefitStart> starts;
  starts.push_back(std::move(start));
  std::vector<std::optional<Refit>> results = fit_all(std::move(starts));
  if (!results.front()) throw_compute("No start of a refit could be simulated.");
  return std::move(results.front().value());
}

}  // namespace matterfit::diagnose
