// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/parameter.hpp"

namespace matterfit::fit {

/// What the data of a fit know of its parameters, in natural coordinates and in numbers alone
/// (uncertainty() says it in physical values and sentences).
struct Information {
  Eigen::VectorXd error;     ///< of each value, linearised; infinite where nothing observes it
  Eigen::VectorXd quantile;  ///< half of a 95 % interval over the error
  /// What data and priors together leave open of each: the errors of values found with their
  /// likeliest weight.
  Eigen::VectorXd narrowed;
  /// 1 on the diagonal; 0 beside it in rows of what no residual and no prior depends on. ±1 where
  /// only a combination is observed.
  Eigen::MatrixXd correlation;
  std::vector<std::vector<Eigen::Index>> unseen;  ///< who takes part in each such combination
  std::vector<bool> sensitive;                    ///< some residual changes with the parameter
  std::vector<Eigen::Index> disagreed;  ///< blocks ask for different values, beyond the noise
  double noise_scale = 1.0;  ///< √(χ²/degrees of freedom): residuals against the stated noise
  bool judged = true;        ///< there are degrees of freedom
  bool smooth = false;       ///< what is missed is so smooth that none are left
};

/// From the Gauss–Newton Hessian JᵀJ + priors at the end of a fit (state.jacobian and
/// state.residual). Where noise_scale is above 1 the noise is taken to be that much larger than
/// stated: without priors errors are multiplied by it; with priors they are those of the values
/// that the fit finds, H⁻¹ (s² JᵀJ + priors) H⁻¹, and the quantiles are Student's for the degrees
/// of freedom in which the noise was seen. `effective` is the number of residuals that count as
/// independent; 0: all that are observed (not 0 with a Jacobian of 0). `huber` as in the fit:
/// errors are then those of Huber's estimator (Huber, Robust Statistics, ch. 7.6). With `blocks`
/// (Problem::blocks()) an error is at least what the blocks' disagreement about the value makes it,
/// H⁻¹ M H⁻¹ with M from the gradients of the blocks (Liang and Zeger 1986): under a wrong law
/// residuals are correlated in ways that no count of independent ones describes. What is observable
/// and the correlations stay those of the noise. Throws Error(kInput) where the sizes differ.
[[nodiscard]] Information information(const std::vector<Parameter>& parameters,
                                      const LeastSquaresState& state, double effective = 0.0,
                                      double huber = 0.0,
                                      const std::vector<std::uint32_t>& blocks = {});

/// How far the discretisation moves the values, in natural coordinates: `change` is what a
/// coarser grid adds to the residuals at the end of the fit, of which `share` is taken to be in the
/// fit as well (a third with a grid twice as coarse and errors of second order). Most of a change
/// no values make up for: it counts as noise of its own size, and the values as known to their
/// scales, so that a direction that hardly changes anything takes no part. 0 where nothing
/// changes. Throws Error(kInput) where the sizes differ.
[[nodiscard]] Eigen::VectorXd grid_shift(const std::vector<Parameter>& parameters,
                                         const LeastSquaresState& state,
                                         const Eigen::VectorXd& change, double share, double huber);

}  // namespace matterfit::fit
