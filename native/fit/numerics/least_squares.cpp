// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/least_squares.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.hpp"
#include "fit/numerics/bounded_step.hpp"
#include "fit/numerics/differences.hpp"
#include "fit/numerics/uncertainty.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeastDamping = 1e-6;
constexpr double kMostDamping = 1e15;
constexpr int kMostTrials = 16;
/// Longest step of a coordinate that is not linear: a factor ten. A far trial may take a hundred
/// times as long to simulate, and is seldom better.
constexpr double kLongest = 2.302585092994046;
/// Each step is held by a spring, as a prior of this many scales about the present point: what the
/// data know no better than that stays, however low the damping. The noise is that of the fit.
constexpr double kHeldWithin = 30.0;

/// The quadratic that stands for the cost around a point, in natural coordinates.
struct QuadraticModel {
  MatrixXd hessian;
  VectorXd gradient;
  VectorXd scaling;  ///< Marquardt's diagonal; 0 for a parameter that nothing moves
  VectorXd spring;
  [[nodiscard]] double decrease(const VectorXd& step) const {
    return -(gradient.dot(step) + 0.5 * step.dot(hessian * step));
  }
  [[nodiscard]] double length(const VectorXd& step) const {
    return std::sqrt(step.cwiseAbs2().dot(scaling));
  }
};

/// Mean square of the residuals that are observed, from the cost.
double mean_square(const LeastSquaresState& state) {
  Index observed = 0;
  for (Index i = 0; i < state.residual.size(); ++i) observed += is_observed(state, i) ? 1 : 0;
  return 2.0 * state.cost / double(std::max<Index>(1, observed));
}

Box natural_bounds(const std::vector<Parameter>& parameters) {
  const auto n = Index(parameters.size());
  Box box{VectorXd(n), VectorXd(n)};
  for (Index k = 0; k < n; ++k) {
    const Parameter& parameter = parameters[std::size_t(k)];
    box.low[k] = to_natural(parameter.coordinate, parameter.low);
    box.high[k] = to_natural(parameter.coordinate, parameter.high);
  }
  return box;
}

double cost_of(const std::vector<Parameter>& parameters, const VectorXd& point,
               const VectorXd& residual, double huber) {
  double sum = 0.0;
  for (const double r : residual) {
    const double size = std::abs(r);
    sum += huber > 0.0 && size > huber ? huber * (2.0 * size - huber) : r * r;
  }
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (!parameters[k].prior) continue;
    const double r = (point[Index(k)] - parameters[k].prior->mean) / parameters[k].prior->sigma;
    sum += r * r;
  }
  return 0.5 * sum;
}

QuadraticModel model_of(const std::vector<Parameter>& parameters, const LeastSquaresState& state,
                        double huber) {
  MatrixXd jacobian = state.jacobian;
  VectorXd residual = state.residual;
  if (huber > 0.0) {
    for (Index i = 0; i < residual.size(); ++i) {
      const double size = std::abs(residual[i]);
      if (size <= huber) continue;
      const double root = std::sqrt(huber / size);
      residual[i] *= root;
      jacobian.row(i) *= root;
    }
  }
  const Index n = jacobian.cols();
  QuadraticModel model{MatrixXd(n, n), VectorXd(n), VectorXd::Zero(n), VectorXd::Zero(n)};
  // Column by column: the sums do not depend on the machine's caches as a blocked product does.
  for (Index i = 0; i < n; ++i) {
    model.gradient[i] = jacobian.col(i).dot(residual);
    for (Index j = 0; j <= i; ++j) {
      model.hessian(i, j) = model.hessian(j, i) = jacobian.col(i).dot(jacobian.col(j));
    }
  }
  for (Index k = 0; k < n; ++k) {
    const Parameter& parameter = parameters[std::size_t(k)];
    if (state.unknown[std::size_t(k)] != 0) continue;
    if (parameter.prior) {
      const double weight = 1.0 / (parameter.prior->sigma * parameter.prior->sigma);
      model.hessian(k, k) += weight;
      model.gradient[k] += weight * (state.point[k] - parameter.prior->mean);
    }
  }
  const double variance = mean_square(state);
  for (Index k = 0; k < n; ++k) {
    if (!(model.hessian(k, k) > 0.0)) continue;
    const double held = kHeldWithin * parameters[std::size_t(k)].scale;
    model.scaling[k] = model.hessian(k, k);
    model.spring[k] = variance / (held * held);
  }
  return model;
}

/// The damped step within `room` (bounds less the point).
VectorXd damped_step(const QuadraticModel& model, double damping, const Box& room) {
  const Index n = model.gradient.size();
  VectorXd root(n);
  for (Index k = 0; k < n; ++k) {
    root[k] = model.scaling[k] > 0.0 ? 1.0 / std::sqrt(model.scaling[k]) : 0.0;
  }
  MatrixXd a = root.asDiagonal() * model.hessian * root.asDiagonal();
  a.diagonal().array() += damping;
  a.diagonal() += root.cwiseAbs2().cwiseProduct(model.spring);
  Box scaled{VectorXd::Zero(n), VectorXd::Zero(n)};
  for (Index k = 0; k < n; ++k) {
    if (root[k] == 0.0) {
      a(k, k) = 1.0;
      continue;
    }
    scaled.low[k] = room.low[k] / root[k];
    scaled.high[k] = room.high[k] / root[k];
  }
  return root.cwiseProduct(bounded_step(a, root.cwiseProduct(model.gradient), scaled));
}

Box room_around(const std::vector<Parameter>& parameters, const Box& bounds,
                const VectorXd& point) {
  Box room{bounds.low - point, bounds.high - point};
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (parameters[k].coordinate == Coordinate::kLinear) continue;
    const auto i = Index(k);
    room.low[i] = std::max(room.low[i], -kLongest);
    room.high[i] = std::min(room.high[i], kLongest);
  }
  return room;
}

VectorXd moved(const VectorXd& point, const VectorXd& step, const Box& bounds) {
  VectorXd trial = point + step;
  for (Index k = 0; k < trial.size(); ++k) {
    const double near = 1e-12 * (bounds.high[k] - bounds.low[k]);
    if (step[k] < 0.0 && trial[k] < bounds.low[k] + near) trial[k] = bounds.low[k];
    if (step[k] > 0.0 && trial[k] > bounds.high[k] - near) trial[k] = bounds.high[k];
  }
  return trial;
}

double relative_size(const std::vector<Parameter>& parameters, const VectorXd& step) {
  double size = 0.0;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    size = std::max(size, std::abs(step[Index(k)]) / parameters[k].scale);
  }
  return size;
}

void finish(LeastSquaresState& state, bool converged, std::string reason) {
  state.finished = true;
  state.converged = converged;
  state.reason = std::move(reason);
}

void check_size(const LeastSquaresState& state, std::size_t parameters) {
  if (state.point.size() == Index(parameters)) return;
  throw_input(
      fmt::format("the state of a fit has {} parameters and the fit {}. Begin the fit anew.",
                  state.point.size(), parameters));
}

/// Broyden's update: the least change of the Jacobian, in units of the scales, with which it
/// explains what the residuals did over a step.
void bring_up_to_date(const std::vector<Parameter>& parameters, const VectorXd& step,
                      const VectorXd& change, MatrixXd& jacobian) {
  VectorXd scaled = step;
  for (Index k = 0; k < step.size(); ++k) {
    scaled[k] /= parameters[std::size_t(k)].scale * parameters[std::size_t(k)].scale;
  }
  const double length = step.dot(scaled);
  if (!(length > 0.0)) return;
  VectorXd missed = change;
  for (Index k = 0; k < step.size(); ++k) missed -= step[k] * jacobian.col(k);
  for (Index k = 0; k < step.size(); ++k) jacobian.col(k) += (scaled[k] / length) * missed;
}

/// Residuals as the cost's gradient weighs them: beyond Huber's threshold they count by their sign.
VectorXd weighed(const VectorXd& residual, double huber) {
  if (!(huber > 0.0)) return residual;
  return residual.cwiseMax(-huber).cwiseMin(huber);
}

/// A derivative that misses the Jacobian's by more than this part of the longest that a column may
/// have is none: kinks, or a simulation that is not smooth.
constexpr double kPlausible = 0.5;

/// The adjoint Broyden update: the least change of the Jacobian with which it gives the cost's
/// exact gradient. False, and no change, where the problem does not tell that, or not plausibly.
bool correct(Problem& problem, const VectorXd& point, const VectorXd& residual, double huber,
             const std::vector<std::uint8_t>& unknown, MatrixXd& jacobian) {
  const VectorXd weights = weighed(residual, huber);
  const double length = weights.squaredNorm();
  if (!(length > 0.0)) return false;
  const auto exact = problem.transposed(point, weights);
  if (!exact || exact->size() != jacobian.cols() || !exact->allFinite()) return false;
  VectorXd missed = VectorXd::Zero(jacobian.cols());
  for (Index k = 0; k < jacobian.cols(); ++k) {
    if (unknown[std::size_t(k)] != 0) continue;
    missed[k] = (*exact)[k] - jacobian.col(k).dot(weights);
    const double longest = jacobian.col(k).norm() * std::sqrt(length);
    if (std::abs(missed[k]) > kPlausible * longest) return false;
  }
  for (Index k = 0; k < jacobian.cols(); ++k) jacobian.col(k) += (missed[k] / length) * weights;
  return true;
}

/// Where a Jacobian comes from, in the order in which they are tried. A corrected one is the one
/// that was tried before it, a kept one or one of one-sided differences.
enum class Slopes : std::uint8_t { kStandIn, kKept, kCorrected, kOneSided, kCentral };

/// A Jacobian is kept after a step that gained at least this part of what it promised.
constexpr double kKeeps = 0.5;
/// One that was taken farther from the point than this, in scales, does not end the search.
constexpr double kNear = 0.05;

/// The relative decrease by which parameters move a tenth of their standard errors: (δ/s.e.)²/N.
double worth_while(const Problem& problem, const VectorXd& residual, double tolerance) {
  constexpr double kTenth = 0.01;
  constexpr double kMost = 1e-4;
  const double independent = residual.size() > 0 ? problem.effective(residual) : 0.0;
  return independent > 0.0 ? std::max(tolerance, std::min(kMost, kTenth / independent)) : tolerance;
}

/// Whether the step before the one just taken, too, lowered the cost by less than `least`: in a
/// crooked valley, or where differences are rough, the model goes on promising more than there is.
bool stalled(const std::vector<LeastSquaresStep>& history, double least) {
  double later = -1.0;
  int iteration = 0;
  int gains = 0;
  for (auto step = history.rbegin(); step != history.rend() && gains < 2; ++step) {
    if (!step->accepted) continue;
    if (later >= 0.0) {
      // Where it stands still the costs are of one point, with other substeps.
      if (step->iteration + 1 != iteration || step->cost - later > least) return false;
      ++gains;
    }
    later = step->cost;
    iteration = step->iteration;
  }
  return gains == 2;
}

/// With a stand-in's slopes: where a few steps are refused, the problem's own lead farther.
constexpr int kBorrowedTrials = 3;
/// An adjoint that was of no use so often is not asked again.
constexpr int kMostVain = 2;
/// With a kept Jacobian: refused, a new one is made here, before steps grow short. Nor is damping
/// that it asked for carried on: on rough ground short steps keep failing, and damping keeps
/// rising.
constexpr int kKeptTrials = 2;

/// A step that moves nothing by more than this part of its standard error, and lowers the cost by
/// no more than that, is the last: what a wrong law misses has many such steps in store.
constexpr double kNothing = 0.1;
constexpr double kLittle = 0.01;
/// Errors are no measure far from the truth, where all that is missed makes them: at most this part
/// of a parameter's scale is nothing.
constexpr double kShort = 0.01;

/// What a search does not go on for.
struct Negligible {
  VectorXd moves;         ///< of each parameter; 0 where that is not known
  double decrease = 0.0;  ///< relative, of the last two steps
  [[nodiscard]] bool moves_nothing(const VectorXd& step) const {
    return (step.cwiseAbs().array() <= moves.array()).all();
  }
};

/// `own`: the Jacobian is the problem's own.
Negligible negligible(const Problem& problem, const std::vector<Parameter>& parameters,
                      const LeastSquaresOptions& options, const LeastSquaresState& state,
                      bool own) {
  constexpr double kFar = 2.0;  // times the noise: what is missed is not noise
  Negligible result{VectorXd::Zero(state.point.size()), options.cost_tolerance};
  const double independent = problem.effective(state.residual);
  if (!(independent > 0.0)) return result;
  if (mean_square(state) > kFar * kFar) {
    result.decrease = std::max(kLittle, result.decrease);
  }
  if (!own) return result;
  const Uncertainty known =
      uncertainty(parameters, state, independent, options.huber, problem.blocks());
  for (Index k = 0; k < state.point.size(); ++k) {
    const Parameter& parameter = parameters[std::size_t(k)];
    const double slope = derivative(parameter.coordinate, state.point[k]);
    const double error = known.estimates[std::size_t(k)].standard_error / slope;
    result.moves[k] = std::min(kNothing * error, kShort * parameter.scale);
  }
  return result;
}

enum class StepOutcome : std::uint8_t { kAccepted, kRough, kFailed };

/// How a step was accepted.
struct Taken {
  bool good = false;  ///< the first that was tried, and it gained most of what it promised
  bool full = false;  ///< a longer one was no better, or hardly anything holds it back
};

/// Tries ever shorter steps until one is accepted.
StepOutcome try_steps(Problem& problem, const std::vector<Parameter>& parameters,
                      const LeastSquaresOptions& options, const QuadraticModel& model,
                      const Box& bounds, const Negligible& nothing, int most_trials,
                      LeastSquaresState& state, Taken& taken) {
  const Box room = room_around(parameters, bounds, state.point);
  const VectorXd full = damped_step(model, kLeastDamping, room);
  double damping = std::max(state.damping, kLeastDamping);
  VectorXd step = damped_step(model, damping, room);
  bool failed = false;
  bool stopped = false;  // some step failed
  for (int trial = 0; trial < most_trials; ++trial) {
    const double predicted = model.decrease(step);
    const double size = relative_size(parameters, step);
    const bool too_short = size < options.step_tolerance || nothing.moves_nothing(step);
    if (!(predicted > 0.0) || (trial > 0 && too_short)) break;
    const VectorXd point = moved(state.point, step, bounds);
    auto result = evaluate(problem, {point}, state.residual.size());
    ++state.evaluations;
    failed = !result.front();
    stopped = stopped || failed;
    const double cost = failed ? std::numeric_limits<double>::infinity()
                               : cost_of(parameters, point, *result.front(), options.huber);
    if (cost < state.cost) {
      const double before = state.cost;
      const double gain = (before - cost) / predicted;
      taken.good = trial == 0 && gain > kKeeps;
      taken.full = !stopped && (trial > 0 || 2.0 * model.length(step) > model.length(full));
      state.point = point;
      state.residual = std::move(*result.front());
      state.cost = cost;
      ++state.iteration;
      state.history.push_back({state.iteration, cost, damping, true});
      // Less damping has just been refused: it stays.
      if (gain > 0.75 && trial == 0) {
        damping = std::max(kLeastDamping, 0.1 * damping);
      } else if (gain < 0.25) {
        damping = std::min(kMostDamping, 2.0 * damping);
      }
      state.damping = damping;
      // A step that damping made short says nothing about convergence.
      if (size < options.step_tolerance &&
          relative_size(parameters, full) < 10.0 * options.step_tolerance) {
        finish(state, true, "The last step was shorter than the tolerance.");
      } else if (before - cost <= options.cost_tolerance * before &&
                 model.decrease(full) <= 10.0 * options.cost_tolerance * before) {
        finish(state, true, "The last step lowered the cost by less than the tolerance.");
      } else if ((trial > 0 || gain < 0.25) && stalled(state.history, nothing.decrease * before)) {
        finish(state, true, "The last two steps lowered the cost by less than the tolerance.");
      }
      return StepOutcome::kAccepted;
    }
    state.history.push_back({state.iteration + 1, state.cost, damping, false});
    // Where the cost rose, to the minimum of the parabola through what is known along the step.
    const double slope = model.gradient.dot(step);
    const double shorter = std::isfinite(cost)
                               ? std::clamp(-0.5 * slope / (cost - state.cost - slope), 0.1, 0.5)
                               : 0.25;
    const double aim = shorter * model.length(step);
    damping = std::max(damping, 1e-3);
    while (model.length(step) > aim && damping < kMostDamping) {
      damping *= 2.0;
      step = damped_step(model, damping, room);
    }
  }
  return failed ? StepOutcome::kFailed : StepOutcome::kRough;
}

/// Makes state.jacobian, and what else of the state there is not yet.
void linearise_at(Problem& problem, const std::vector<Parameter>& parameters,
                  const LeastSquaresOptions& options, Slopes slopes, LeastSquaresState& state) {
  const Box bounds = natural_bounds(parameters);
  const bool fresh = state.residual.size() == 0;
  const bool central = slopes == Slopes::kCentral || (slopes == Slopes::kKept && state.central);
  const auto take = [&](Differences found, bool with_residual) {
    state.evaluations += found.evaluations;
    if (with_residual) state.residual = std::move(found.residual);
    state.jacobian = std::move(found.jacobian);
    state.unknown = std::move(found.unknown);
  };
  const auto differ = [&](Problem& of, const VectorXd& point, const VectorXd& residual) {
    return differences(of, parameters, bounds, point, residual, options.difference, central);
  };
  if (slopes == Slopes::kStandIn) {
    if (fresh) {
      auto result = evaluate(problem, {state.point}, 0);
      ++state.evaluations;
      if (!result.front()) {
        throw_compute(kNotCompleted);
      }
      state.residual = std::move(*result.front());
    }
    take(differ(*problem.stand_in(), state.point, {}), false);
    if (state.jacobian.rows() != state.residual.size()) {
      throw_compute("the stand-in of a fit has another number of residuals.");
    }
  } else if (slopes == Slopes::kKept) {
    if (state.jacobian.size() == 0) {
      // Counted when it was first made.
      Differences found = differ(problem, state.anchor, {});
      int passed = 0;
      const auto corrected = [&](const VectorXd& at) {
        const auto& where = state.corrected;
        if (std::find(where.begin(), where.end(), passed++) == where.end()) return;
        if (!correct(problem, at, found.residual, options.huber, found.unknown, found.jacobian)) {
          throw_compute("a fit that goes on meets another simulation.");
        }
      };
      corrected(state.anchor);
      const VectorXd* from = &state.anchor;
      for (const VectorXd& to : state.trail) {
        auto residual = evaluate(problem, {to}, found.residual.size());
        if (!residual.front()) throw_compute("a fit that goes on meets another simulation.");
        bring_up_to_date(parameters, to - *from, *residual.front() - found.residual,
                         found.jacobian);
        found.residual = std::move(*residual.front());
        corrected(to);
        from = &to;
      }
      state.jacobian = std::move(found.jacobian);
      state.unknown = std::move(found.unknown);
    }
  } else {
    take(differ(problem, state.point, state.residual), true);
  }
  if (!fresh) return;
  state.cost = cost_of(parameters, state.point, state.residual, options.huber);
  if (!std::isfinite(state.cost)) {
    throw_compute(
        "the residuals are too large at the values that the search has come to. Give other start "
        "values.");
  }
  state.history.push_back({state.iteration, state.cost, state.damping, true});
}

}  // namespace

LeastSquares::LeastSquares(std::vector<Parameter> parameters, LeastSquaresOptions options)
    : parameters_(std::move(parameters)), options_(options) {
  if (parameters_.empty()) throw_input("fit.parameters: there is nothing to fit; name one.");
  for (const Parameter& parameter : parameters_) check(parameter);
  const bool sane = options_.iterations >= 0 && options_.huber >= 0.0 &&
                    options_.step_tolerance >= 0.0 && options_.cost_tolerance >= 0.0 &&
                    options_.difference > 0.0 && std::isfinite(options_.difference);
  if (!sane) {
    throw_input(
        "fit: the number of iterations, the Huber threshold and the tolerances must not be "
        "negative, and the step of the differences must be above 0.");
  }
}

LeastSquaresState LeastSquares::start() const {
  const Box bounds = natural_bounds(parameters_);
  LeastSquaresState state;
  state.point.resize(Index(parameters_.size()));
  for (std::size_t k = 0; k < parameters_.size(); ++k) {
    const auto i = Index(k);
    state.point[i] = std::clamp(to_natural(parameters_[k].coordinate, parameters_[k].start),
                                bounds.low[i], bounds.high[i]);
  }
  return state;
}

void LeastSquares::iterate(Problem& problem, LeastSquaresState& state) const {
  if (state.finished) return;
  check_size(state, parameters_.size());
  const Box bounds = natural_bounds(parameters_);
  LeastSquaresState next = state;
  const bool borrows = problem.stand_in() != nullptr;
  const Slopes usual = Slopes::kOneSided;
  const double columns = double(parameters_.size());
  const auto adjoint_is_cheaper = [&, cost = problem.transposed_cost()](double than) {
    return cost > 0.0 && cost < than && next.vain < kMostVain;
  };
  LeastSquaresOptions options = options_;
  options.cost_tolerance = worth_while(problem, next.residual, options_.cost_tolerance);
  Slopes slopes = usual;
  if (borrows && !next.own) slopes = Slopes::kStandIn;
  if (next.anchor.size() > 0 && next.residual.size() > 0) slopes = Slopes::kKept;
  for (;;) {
    if (slopes == Slopes::kStandIn) {
      try {
        linearise_at(problem, parameters_, options, slopes, next);
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::kCompute) throw;
        slopes = usual;
      }
    }
    if (slopes == Slopes::kCorrected) {
      const bool corrected =
          correct(problem, next.point, next.residual, options.huber, next.unknown, next.jacobian);
      next.evaluations += int(std::ceil(problem.transposed_cost()));
      if (corrected) {
        next.corrected.push_back(int(next.trail.size()));
      } else {
        ++next.vain;
        slopes = next.anchor.size() > 0 ? usual : Slopes::kCentral;
      }
    }
    if (slopes != Slopes::kStandIn && slopes != Slopes::kCorrected) {
      next.own = borrows;
      if (slopes != Slopes::kKept) next.forget_slopes();
      linearise_at(problem, parameters_, options, slopes, next);
    }
    const bool all_known =
        std::all_of(next.unknown.begin(), next.unknown.end(), [](auto u) { return u == 0; });
    const QuadraticModel model = model_of(parameters_, next, options.huber);
    if (!model.hessian.allFinite()) throw_compute("the fit's residuals are too large.");
    if (next.iteration >= options.iterations) break;
    const Box room = room_around(parameters_, bounds, next.point);
    const bool still = model.scaling.maxCoeff() == 0.0;
    const double left = still ? 0.0 : model.decrease(damped_step(model, kLeastDamping, room));
    const VectorXd from = next.point;
    // From an earlier iteration, corrected or not.
    const bool kept = next.anchor.size() > 0;
    // Where this iteration's own Jacobian was taken.
    const auto anchor_at = [&](const VectorXd& point) {
      if (kept) return;
      next.anchor = point;
      next.central = slopes == Slopes::kCentral;
    };
    const auto far = [&] {
      return kept && relative_size(parameters_, next.point - next.anchor) > kNear;
    };
    if (left <= options.cost_tolerance * next.cost) {
      if (slopes == Slopes::kStandIn || far()) {
        slopes = usual;
        continue;
      }
      if (still) {
        finish(next, false,
               all_known ? "Nothing that is compared changes with any of the parameters."
                         : "The simulation could not be completed beside this point.");
      } else {
        finish(next, all_known,
               all_known ? "No step would lower the cost by more than the tolerance."
                         : "No step would lower the cost by more than the tolerance; for some "
                           "parameters the simulation could not be completed beside this point.");
      }
      anchor_at(next.point);
      break;
    }
    const Negligible nothing =
        negligible(problem, parameters_, options, next, slopes != Slopes::kStandIn);
    const VectorXd before = next.residual;
    const double cost_before = next.cost;
    const double damping_before = next.damping;
    Taken taken;
    const int most_trials = slopes == Slopes::kKept              ? kKeptTrials
                            : slopes == Slopes::kStandIn || kept ? kBorrowedTrials
                                                                 : kMostTrials;
    const StepOutcome outcome =
        try_steps(problem, parameters_, options, model, bounds, nothing, most_trials, next, taken);
    if (outcome == StepOutcome::kAccepted) {
      next.converged = next.converged && all_known;
      if (slopes == Slopes::kStandIn) {
        // Its tolerance is not that of the problem itself.
        if (next.finished || !taken.good) next.own = true;
        next.finished = next.converged = false;
        next.reason.clear();
      } else {
        anchor_at(from);
        if (far()) next.finished = next.converged = false;
        const VectorXd step = next.point - from;
        if (!next.finished && !far() && taken.full && all_known &&
            cost_before - next.cost <= kLittle * cost_before && nothing.moves_nothing(step)) {
          finish(next, true, "The last step moved nothing by a tenth of its standard error.");
        }
        if (kept && !taken.good) next.damping = damping_before;
        if (next.finished || taken.good) {
          next.trail.push_back(next.point);
          bring_up_to_date(parameters_, step, next.residual - before, next.jacobian);
        } else {
          next.forget_slopes();
        }
      }
      break;
    }
    // One-sided differences are off by half their step; what is exact may still point downhill.
    if (slopes == Slopes::kKept) {
      slopes = adjoint_is_cheaper(columns) ? Slopes::kCorrected : usual;
    } else if (slopes == Slopes::kStandIn) {
      slopes = usual;
    } else if (slopes == Slopes::kCorrected) {
      // No short step along the exact gradient: the cost is rough, and differences may see past it.
      ++next.vain;
      slopes = kept ? usual : Slopes::kCentral;
    } else if (slopes == Slopes::kOneSided && options.thorough) {
      slopes = adjoint_is_cheaper(2.0 * columns) ? Slopes::kCorrected : Slopes::kCentral;
    } else {
      const bool rough = outcome == StepOutcome::kRough;
      finish(next, rough && all_known,
             rough && all_known
                 ? "No shorter step lowers the cost: what is nearer to the minimum than this is "
                   "hidden by the simulation's own roughness."
             : rough ? "No shorter step lowers the cost, and for some parameters the simulation "
                       "could not be completed beside this point."
                     : "No shorter step could be simulated to its end.");
      anchor_at(next.point);
      break;
    }
  }
  if (!next.finished && next.iteration >= options.iterations) {
    finish(next, false, fmt::format("The limit of {} iterations was reached.", options.iterations));
  }
  state = std::move(next);
}

void LeastSquares::linearise(Problem& problem, LeastSquaresState& state) const {
  check_size(state, parameters_.size());
  // A correction makes the gradient exact, and each block of the data no better known.
  const bool kept = problem.stand_in() != nullptr && state.anchor.size() > 0 &&
                    state.residual.size() > 0 && state.corrected.empty();
  linearise_at(problem, parameters_, options_, kept ? Slopes::kKept : Slopes::kCentral, state);
}

}  // namespace matterfit::fit
