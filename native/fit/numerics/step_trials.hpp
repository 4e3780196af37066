// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "fit/numerics/bounded_step.hpp"
#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/negligible.hpp"
#include "fit/numerics/parameter.hpp"
#include "fit/numerics/quadratic_model.hpp"

namespace matterfit::fit {

/// How the tries of a step ended: one lowered the cost, none did, or the last could not be
/// simulated.
enum class StepOutcome : std::uint8_t { kAccepted, kRough, kFailed };

/// How a step was accepted.
struct Taken {
  bool good = false;  ///< the first that was tried, and it gained most of what it promised
  bool full = false;  ///< a longer one was no better, or hardly anything holds it back
};

/// Tries ever shorter steps, `most_trials` at most, until one is accepted: where the cost rose to
/// the minimum of the parabola along the step, where the simulation failed to a quarter. An
/// accepted one moves the state, and sets `finished` where nothing is left to gain. Throws
/// Error(kCancelled).
StepOutcome try_steps(Problem& problem, const std::vector<Parameter>& parameters,
                      const LeastSquaresOptions& options, const QuadraticModel& model,
                      const Box& bounds, const Negligible& nothing, int most_trials,
                      LeastSquaresState& state, Taken& taken);

}  // namespace matterfit::fit
