// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "fit/numerics/parameter.hpp"

namespace matterfit::fit {

/// Those of the parameters from `first` on, each of which has a prior, that data of the stated
/// noise determine at least as well as their priors do, with all that are kept, and those before
/// `first`, fitted beside them: the one whose error (of JᵀJ + priors) is largest against its prior
/// is left out, until all that are left have at most 1/√2 of theirs. Ascending. `jacobian` is that
/// of the residuals divided by their noise, by natural coordinates (LeastSquaresState::jacobian).
/// Throws Error(kInput) where the sizes differ or a prior is missing.
[[nodiscard]] std::vector<std::size_t> excited(const std::vector<Parameter>& parameters,
                                               const Eigen::MatrixXd& jacobian, std::size_t first);

}  // namespace matterfit::fit
