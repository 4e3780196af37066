// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "fit/numerics/uncertainty.hpp"
#include "fit/search/law_state.hpp"
#include "fit/search/problems.hpp"
#include "fit/search/stages.hpp"

namespace matterfit::fit {

/// Standard errors and correlations of the values where a search has ended, with what the grid may
/// have moved them by: one more simulation, at twice the particle separation. `problem` and
/// `parameters` are those of the last stage, `at_end` the state linearised there; `far`: it misses
/// the captures by more than noise and grid explain. Where the coarser scene cannot be simulated
/// `statements` says so. Throws Error(kCancelled).
[[nodiscard]] Uncertainty errors_of_values(SearchProblems& problems, const SearchStage& stage,
                                           const CaptureProblem& problem,
                                           const std::vector<Parameter>& parameters,
                                           const LawState& at_end, bool far,
                                           std::vector<std::string>& statements);

}  // namespace matterfit::fit
