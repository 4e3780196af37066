// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>

#include "diagnose/noise.hpp"
#include "diagnose/refit.hpp"
#include "diagnose/spread.hpp"
#include "diagnose/study.hpp"

namespace matterfit::diagnose {

/// The noise of what a model leaves (`stacked`, measured less predicted [m]), used rows alone,
/// where `slopes` were made.
[[nodiscard]] Noise noise_left(const Study& study, const Eigen::VectorXd& stacked,
                               const Linearised& slopes, const Spread& spread);

/// Where about the base of a model with corrections ends, with an exact solver: the fit knew of
/// none. Begins at `state`, or where that is far off at the best of Model::other_starts().
/// Throws Error(kCompute) where it cannot be simulated.
[[nodiscard]] State come_near(const Study& study, const State& state, const RefitOptions& options);

}  // namespace matterfit::diagnose
