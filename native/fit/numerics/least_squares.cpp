// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/least_squares.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.hpp"
#include "fit/numerics/bounded_step.hpp"
#include "fit/numerics/negligible.hpp"
#include "fit/numerics/quadratic_model.hpp"
#include "fit/numerics/slopes.hpp"
#include "fit/numerics/step_trials.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void check_size(const LeastSquaresState& state, std::size_t parameters) {
  if (state.point.size() == Index(parameters)) return;
  throw_input(
      fmt::format("the state of a fit has {} parameters and the fit {}. Begin the fit anew.",
                  state.point.size(), parameters));
}

constexpr int kMostTrials = 16;
/// With a stand-in's slopes: where a few steps are refused, the problem's own lead farther.
constexpr int kBorrowedTrials = 3;
/// An adjoint that was of no use so often is not asked again.
constexpr int kMostVain = 2;
/// With a kept Jacobian: refused, a new one is made here, before steps grow short. Nor is damping
/// that it asked for carried on: on rough ground short steps keep failing, and damping keeps
/// rising.
constexpr int kKeptTrials = 2;
/// One that was taken farther from the point than this, in scales, does not end the search.
constexpr double kNear = 0.05;

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
        next.finish(false, all_known
                               ? "Nothing that is compared changes with any of the parameters."
                               : "The simulation could not be completed beside this point.");
      } else {
        next.finish(all_known,
                    all_known
                        ? "No step would lower the cost by more than the tolerance."
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
          next.finish(true, "The last step moved nothing by a tenth of its standard error.");
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
      next.finish(
          rough && all_known,
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
    next.finish(false, fmt::format("The limit of {} iterations was reached.", options.iterations));
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
