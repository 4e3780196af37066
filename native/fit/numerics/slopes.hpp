// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/parameter.hpp"

/// The Jacobian of a search: where it comes from, and how it is kept up to date.
namespace matterfit::fit {

/// Where a Jacobian comes from, in the order in which they are tried. A corrected one is the one
/// that was tried before it, a kept one or one of one-sided differences.
enum class Slopes : std::uint8_t { kStandIn, kKept, kCorrected, kOneSided, kCentral };

/// Makes state.jacobian of any but a corrected one, and what else of the state there is not yet.
/// Throws Error(kCompute) where the point itself cannot be evaluated, where a stand-in has another
/// number of residuals, and where what was kept cannot be made again.
void linearise_at(Problem& problem, const std::vector<Parameter>& parameters,
                  const LeastSquaresOptions& options, Slopes slopes, LeastSquaresState& state);

/// Broyden's update: the least change of the Jacobian, in units of the scales, with which it
/// explains what the residuals did over a step.
void bring_up_to_date(const std::vector<Parameter>& parameters, const Eigen::VectorXd& step,
                      const Eigen::VectorXd& change, Eigen::MatrixXd& jacobian);

/// The adjoint Broyden update: the least change of the Jacobian with which it gives the cost's
/// exact gradient. False, and no change, where the problem has no gradient, or not a plausible one.
[[nodiscard]] bool correct(Problem& problem, const Eigen::VectorXd& point,
                           const Eigen::VectorXd& residual, double huber,
                           const std::vector<std::uint8_t>& unknown, Eigen::MatrixXd& jacobian);

}  // namespace matterfit::fit
