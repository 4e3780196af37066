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

/// One iteration of a search: which slopes it takes, and what comes of the steps that they give.
class Iteration {
 public:
  Iteration(Problem& problem, const std::vector<Parameter>& parameters,
            const LeastSquaresOptions& options, LeastSquaresState& state)
      : problem_(problem),
        parameters_(parameters),
        bounds_(natural_bounds(parameters)),
        options_(options),
        state_(state),
        borrows_(problem.stand_in() != nullptr) {
    options_.cost_tolerance = worth_while(problem, state.residual, options.cost_tolerance);
    if (borrows_ && !state.own) slopes_ = Slopes::kStandIn;
    if (state.anchor.size() > 0 && state.residual.size() > 0) slopes_ = Slopes::kKept;
  }

  /// Linearises and tries steps until one is accepted or nothing is left to try.
  void run() {
    for (;;) {
      take_slopes();
      const QuadraticModel model = model_of(parameters_, state_, options_.huber);
      if (!model.hessian.allFinite()) throw_compute("the fit's residuals are too large.");
      if (state_.iteration >= options_.iterations) return;
      const bool still = model.scaling.maxCoeff() == 0.0;
      if (promised(model, still) <= options_.cost_tolerance * state_.cost) {
        if (slopes_ == Slopes::kStandIn || far()) {
          slopes_ = Slopes::kOneSided;
          continue;
        }
        finish_with_nothing_left(still);
        return;
      }
      const StepOutcome outcome = step(model);
      if (outcome == StepOutcome::kAccepted || !take_others(outcome)) return;
    }
  }

 private:
  /// The Jacobian by `slopes_`, or by what is tried where those cannot be had.
  void take_slopes() {
    if (slopes_ == Slopes::kStandIn) {
      try {
        linearise_at(problem_, parameters_, options_, slopes_, state_);
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::kCompute) throw;
        slopes_ = Slopes::kOneSided;
      }
    }
    if (slopes_ == Slopes::kCorrected) {
      const bool corrected = correct(problem_, state_.point, state_.residual, options_.huber,
                                     state_.unknown, state_.jacobian);
      state_.evaluations += int(std::ceil(problem_.transposed_cost()));
      if (corrected) {
        state_.corrected.push_back(int(state_.trail.size()));
      } else {
        ++state_.vain;
        slopes_ = kept() ? Slopes::kOneSided : Slopes::kCentral;
      }
    }
    if (slopes_ != Slopes::kStandIn && slopes_ != Slopes::kCorrected) {
      state_.own = borrows_;
      if (slopes_ != Slopes::kKept) state_.forget_slopes();
      linearise_at(problem_, parameters_, options_, slopes_, state_);
    }
    all_known_ = std::ranges::all_of(state_.unknown, [](auto u) { return u == 0; });
  }

  /// How much the model says that the cost can be lowered by.
  [[nodiscard]] double promised(const QuadraticModel& model, bool still) const {
    if (still) return 0.0;
    const Box room = room_around(parameters_, bounds_, state_.point);
    return model.decrease(damped_step(model, kLeastDamping, room));
  }

  /// Whether the Jacobian is from an earlier iteration, corrected or not.
  [[nodiscard]] bool kept() const { return state_.anchor.size() > 0; }

  /// Whether it was taken far from here.
  [[nodiscard]] bool far() const {
    return kept() && relative_size(parameters_, state_.point - state_.anchor) > kNear;
  }

  /// Says where this iteration's own Jacobian was taken.
  void anchor_at(const VectorXd& point) {
    if (kept()) return;
    state_.anchor = point;
    state_.central = slopes_ == Slopes::kCentral;
  }

  void finish_with_nothing_left(bool still) {
    if (still) {
      state_.finish(false, all_known_
                               ? "Nothing that is compared changes with any of the parameters."
                               : "The simulation could not be completed beside this point.");
    } else {
      state_.finish(all_known_,
                    all_known_
                        ? "No step would lower the cost by more than the tolerance."
                        : "No step would lower the cost by more than the tolerance; for some "
                          "parameters the simulation could not be completed beside this point.");
    }
    anchor_at(VectorXd(state_.point));
  }

  /// Tries steps of the model; one that is accepted goes into the state.
  StepOutcome step(const QuadraticModel& model) {
    const Negligible nothing =
        negligible(problem_, parameters_, options_, state_, slopes_ != Slopes::kStandIn);
    const Before before{state_.point, state_.residual, state_.cost, state_.damping};
    Taken taken;
    const StepOutcome outcome = try_steps(problem_, parameters_, options_, model, bounds_, nothing,
                                          most_trials(), state_, taken);
    if (outcome != StepOutcome::kAccepted) return outcome;
    state_.converged = state_.converged && all_known_;
    if (slopes_ == Slopes::kStandIn) {
      // Its tolerance is not that of the problem itself.
      if (state_.finished || !taken.good) state_.own = true;
      state_.finished = state_.converged = false;
      state_.reason.clear();
    } else {
      accept(before, taken, nothing);
    }
    return outcome;
  }

  struct Before {
    VectorXd point;
    VectorXd residual;
    double cost = 0.0;
    double damping = 0.0;
  };

  [[nodiscard]] int most_trials() const {
    if (slopes_ == Slopes::kKept) return kKeptTrials;
    return slopes_ == Slopes::kStandIn || kept() ? kBorrowedTrials : kMostTrials;
  }

  /// A step by slopes of the problem's own.
  void accept(const Before& before, const Taken& taken, const Negligible& nothing) {
    const bool was_kept = kept();
    anchor_at(before.point);
    const bool is_far = was_kept && far();
    if (is_far) state_.finished = state_.converged = false;
    const VectorXd step = state_.point - before.point;
    if (!state_.finished && !is_far && taken.full && all_known_ &&
        before.cost - state_.cost <= kLittle * before.cost && nothing.moves_nothing(step)) {
      state_.finish(true, "The last step moved nothing by a tenth of its standard error.");
    }
    if (was_kept && !taken.good) state_.damping = before.damping;
    if (state_.finished || taken.good) {
      state_.trail.push_back(state_.point);
      bring_up_to_date(parameters_, step, state_.residual - before.residual, state_.jacobian);
    } else {
      state_.forget_slopes();
    }
  }

  [[nodiscard]] bool adjoint_is_cheaper(double than) const {
    const double cost = problem_.transposed_cost();
    return cost > 0.0 && cost < than && state_.vain < kMostVain;
  }

  /// Other slopes where no step along these helped. False: there are none, and the search has
  /// ended.
  bool take_others(StepOutcome outcome) {
    const auto columns = double(parameters_.size());
    // One-sided differences are off by half their step; what is exact may still point downhill.
    if (slopes_ == Slopes::kKept) {
      slopes_ = adjoint_is_cheaper(columns) ? Slopes::kCorrected : Slopes::kOneSided;
    } else if (slopes_ == Slopes::kStandIn) {
      slopes_ = Slopes::kOneSided;
    } else if (slopes_ == Slopes::kCorrected) {
      // No short step along the exact gradient: the cost is rough, and differences may see past it.
      ++state_.vain;
      slopes_ = kept() ? Slopes::kOneSided : Slopes::kCentral;
    } else if (slopes_ == Slopes::kOneSided && options_.thorough) {
      slopes_ = adjoint_is_cheaper(2.0 * columns) ? Slopes::kCorrected : Slopes::kCentral;
    } else {
      finish_where_it_is_rough(outcome == StepOutcome::kRough);
      return false;
    }
    return true;
  }

  void finish_where_it_is_rough(bool rough) {
    state_.finish(
        rough && all_known_,
        rough && all_known_
            ? "No shorter step lowers the cost: what is nearer to the minimum than this is "
              "hidden by the simulation's own roughness."
        : rough ? "No shorter step lowers the cost, and for some parameters the simulation "
                  "could not be completed beside this point."
                : "No shorter step could be simulated to its end.");
    anchor_at(VectorXd(state_.point));
  }

  Problem& problem_;
  const std::vector<Parameter>& parameters_;
  Box bounds_;
  LeastSquaresOptions options_;
  LeastSquaresState& state_;
  bool borrows_;
  Slopes slopes_ = Slopes::kOneSided;
  bool all_known_ = true;
};

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
  LeastSquaresState next = state;
  Iteration(problem, parameters_, options_, next).run();
  if (!next.finished && next.iteration >= options_.iterations) {
    next.finish(false, fmt::format("The limit of {} iterations was reached.", options_.iterations));
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
