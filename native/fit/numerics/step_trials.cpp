// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/step_trials.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fit/numerics/differences.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kMostDamping = 1e15;
/// A Jacobian is kept after a step that gained at least this part of what it promised.
constexpr double kKeeps = 0.5;

VectorXd moved(const VectorXd& point, const VectorXd& step, const Box& bounds) {
  VectorXd trial = point + step;
  for (Index k = 0; k < trial.size(); ++k) {
    const double near = 1e-12 * (bounds.high[k] - bounds.low[k]);
    if (step[k] < 0.0 && trial[k] < bounds.low[k] + near) trial[k] = bounds.low[k];
    if (step[k] > 0.0 && trial[k] > bounds.high[k] - near) trial[k] = bounds.high[k];
  }
  return trial;
}

}  // namespace

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
        state.finish(true, "The last step was shorter than the tolerance.");
      } else if (before - cost <= options.cost_tolerance * before &&
                 model.decrease(full) <= 10.0 * options.cost_tolerance * before) {
        state.finish(true, "The last step lowered the cost by less than the tolerance.");
      } else if ((trial > 0 || gain < 0.25) && stalled(state.history, nothing.decrease * before)) {
        state.finish(true, "The last two steps lowered the cost by less than the tolerance.");
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

}  // namespace matterfit::fit
