// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fit/numerics/uncertainty.hpp"
#include "fit/search/law_state.hpp"
#include "fit/search/problems.hpp"
#include "fit/search/stages.hpp"

namespace matterfit::fit {

/// The grid that tells how much the values depend on it, as a multiple of the fit's separation, and
/// what the fit has of the difference itself: errors of second order (docs/validation.md).
inline constexpr double kCoarser = 2.0;
inline constexpr double kOfCoarser = 1.0 / (kCoarser * kCoarser - 1.0);

/// The change that add_grid_error() takes: `residuals`, those at a larger separation, less `fine`.
/// Residuals that throw Error(kInput) or Error(kCompute) are told in `statements`: there is nothing
/// then.
[[nodiscard]] std::optional<Eigen::VectorXd> grid_change(
    const Eigen::VectorXd& fine, const std::function<Eigen::VectorXd()>& residuals,
    std::vector<std::string>& statements);

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
