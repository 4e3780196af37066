// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "diagnose/refit.hpp"
#include "diagnose/study.hpp"
#include "diagnose/trials.hpp"

namespace matterfit::diagnose {

/// Starts of refits from a base that is far off, where the slope of a cause at its neutral value is
/// of another motion: a body that rings at half its frequency looks as if less mass hung on it.
/// Each effect that names sizes for it (Effect::far_tries) is simulated beside `base` at the middle
/// one in all its shapes, the better of these at all sizes, and then about the best of them, each
/// time with `base`'s parameters as they adapt to first order to what is left of the used rows,
/// within their bounds, by `slopes` ([θ] derivatives in scales, stacked); it begins where least is
/// left. Effects among `known` are left out, and those that cannot be simulated. Throws
/// Error(kCancelled).
[[nodiscard]] std::vector<Attempt> far_starts(const Refitter& refitter, const State& base,
                                              const Eigen::MatrixXd& slopes,
                                              const std::vector<int>& known);

}  // namespace matterfit::diagnose
