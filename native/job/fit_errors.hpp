// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "fit/numerics/uncertainty.hpp"
#include "job/fit_problems.hpp"
#include "job/fit_stages.hpp"
#include "job/fit_state.hpp"

namespace matterfit::job {

/// Standard errors and correlations of the values where a search has ended, with what the grid may
/// have moved them by: one more simulation, at twice the particle separation. `problem` and
/// `parameters` are those of the last stage, `at_end` the state linearised there; `far`: it misses
/// the captures by more than noise and grid explain. Where the coarser scene cannot be simulated
/// `statements` says so. Throws Error(kCancelled).
[[nodiscard]] fit::Uncertainty errors_of_values(FitProblems& problems, const FitStage& stage,
                                                const fit::CaptureProblem& problem,
                                                const std::vector<fit::Parameter>& parameters,
                                                const LawState& at_end, bool far,
                                                std::vector<std::string>& statements);

}  // namespace matterfit::job
