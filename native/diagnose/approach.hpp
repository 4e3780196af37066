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

struct Approach {
  State state;
  bool elsewhere = false;  ///< it did not begin where the fit had ended
};

/// A search with an exact solver for where the base of a model with corrections ends: the fit knew
/// of no corrections. Begins at `state`; where that leaves more than four times the noise that
/// captures state, at whichever leaves least of `state` and Model::other_starts(). Throws
/// Error(kCompute) where none can be simulated.
[[nodiscard]] Approach come_near(const Study& study, const State& state,
                                 const RefitOptions& options);

}  // namespace matterfit::diagnose
