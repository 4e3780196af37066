// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "diagnose/refit.hpp"
#include "diagnose/spread.hpp"

namespace matterfit::diagnose {

/// `state` with its parameters refitted to what was seen before `onset` [s], when what sets in then
/// had not disturbed them yet: where a search for such a cause begins. `slopes`: derivatives by the
/// parameters at `state`, stacked. Nothing where too little was seen before, or it cannot be
/// simulated.
[[nodiscard]] std::optional<State> fitted_before(const Study& study, const Noise& noise,
                                                 const Spread& spread, const State& state,
                                                 const Eigen::MatrixXd& slopes, double onset,
                                                 const RefitOptions& options);

}  // namespace matterfit::diagnose
