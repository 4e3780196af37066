// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "diagnose/study.hpp"

namespace matterfit::diagnose {

/// Stated noise of each of the rows, or a usual one [m].
[[nodiscard]] Eigen::VectorXd stated_noise(const Model& model, const Rows& rows);

/// Moves the runs of other numerics to where they come nearest to the first one, `runs[0]` at
/// `state`, in the used rows: what a solver gets wrong is what is left once its free numbers have
/// adapted. These are the model's nuisances of known times, if it has any. With `all` they are its
/// parameters: by searches where it has no nuisances of times and slopes leave something (a grid
/// that makes a beam softer shifts its phase by more than a radian, and slopes alone leave the
/// deviation of another vibration), and in the end by slopes, which whatever varies a deviation
/// further, or compares its size with a residual, must be rid of. `runs`: one a variant, stacked,
/// or nothing; `theta`: derivatives at the state, in scales. Throws Error(kCancelled).
void bring_near(const Study& study, const State& state, const Eigen::MatrixXd& theta,
                const std::vector<Numerics>& variants, bool all,
                std::vector<std::optional<Eigen::VectorXd>>& runs);

}  // namespace matterfit::diagnose
