// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>

namespace matterfit::fit {

/// Lower and upper bounds of every component; infinite where there is none.
struct Box {
  Eigen::VectorXd low;
  Eigen::VectorXd high;
};

/// The minimiser of gᵀs + ½ sᵀAs within `box`, which contains 0. `a` is symmetric and positive
/// definite. Primal active set: exact, not the unbounded minimiser cut off at the bounds.
/// Reference: Nocedal and Wright, Numerical Optimization, ch. 16.5.
[[nodiscard]] Eigen::VectorXd bounded_step(const Eigen::MatrixXd& a, const Eigen::VectorXd& g,
                                           const Box& box);

}  // namespace matterfit::fit
