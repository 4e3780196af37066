// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "fit/numerics/bounded_step.hpp"
#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/parameter.hpp"

/// The cost of a search, the quadratic that stands for it around a point, and the damped step of
/// Levenberg–Marquardt that makes it least. All in natural coordinates.
namespace matterfit::fit {

/// The damping of a search falls no lower.
inline constexpr double kLeastDamping = 1e-6;

/// The quadratic that stands for the cost around a point, in natural coordinates.
struct QuadraticModel {
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
  Eigen::VectorXd scaling;  ///< Marquardt's diagonal; 0 for a parameter that nothing moves
  Eigen::VectorXd spring;
  [[nodiscard]] double decrease(const Eigen::VectorXd& step) const {
    return -(gradient.dot(step) + 0.5 * step.dot(hessian * step));
  }
  [[nodiscard]] double length(const Eigen::VectorXd& step) const {
    return std::sqrt(step.cwiseAbs2().dot(scaling));
  }
};

/// ½ Σ ρ(r²) + priors at a point; `huber` as in LeastSquaresOptions.
[[nodiscard]] double cost_of(const std::vector<Parameter>& parameters, const Eigen::VectorXd& point,
                             const Eigen::VectorXd& residual, double huber);

/// Mean square of the residuals that are observed, from the cost.
[[nodiscard]] double mean_square(const LeastSquaresState& state);

/// At the state's point, from its residuals and its Jacobian.
[[nodiscard]] QuadraticModel model_of(const std::vector<Parameter>& parameters,
                                      const LeastSquaresState& state, double huber);

/// The parameters' bounds.
[[nodiscard]] Box natural_bounds(const std::vector<Parameter>& parameters);

/// How far a step from `point` may go: to `bounds`, and in a coordinate that is not linear no
/// farther than a factor ten.
[[nodiscard]] Box room_around(const std::vector<Parameter>& parameters, const Box& bounds,
                              const Eigen::VectorXd& point);

/// The damped step within `room` (bounds less the point).
[[nodiscard]] Eigen::VectorXd damped_step(const QuadraticModel& model, double damping,
                                          const Box& room);

/// The largest |Δξ|/scale of a step.
[[nodiscard]] double relative_size(const std::vector<Parameter>& parameters,
                                   const Eigen::VectorXd& step);

}  // namespace matterfit::fit
