// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/parameter.hpp"

namespace matterfit::fit {

/// What a fit knows of one parameter.
struct Estimate {
  double value = 0.0;           ///< physical
  double standard_error = 0.0;  ///< physical, linearised; infinite where nothing observes it
  /// Physical: what the grid makes it wrong by, about; 0: not known (add_grid_error()).
  double grid_error = 0.0;
  /// 95 % interval of both errors, through the natural coordinate, within bounds.
  double low = 0.0;
  double high = 0.0;
  double quantile = 0.0;  ///< half of that interval over the error
  bool at_bound = false;
  /// The data narrow it: its error is below its scale. With a prior: they know at least as much of
  /// it as the prior does, so its error is below 1/√2 of the prior's.
  bool observable = true;
  std::string statement;  ///< empty, or what is not observed and why, and what to record to see it
};

struct Uncertainty {
  std::vector<Estimate> estimates;
  /// 1 on the diagonal; 0 beside it in rows of what no residual and no prior depends on. ±1 where
  /// only a combination is observed.
  Eigen::MatrixXd correlation;
  double noise_scale = 1.0;  ///< √(χ²/degrees of freedom): residuals against the stated noise
  std::vector<std::string> statements;  ///< strong correlations, directions that nothing observes
};

/// From the Gauss–Newton Hessian JᵀJ + priors at the end of a fit (state.jacobian and
/// state.residual). Where noise_scale is above 1 the noise is taken to be that much larger than
/// stated: without priors errors are multiplied by it; with priors they are those of the values
/// that the fit finds, H⁻¹ (s² JᵀJ + priors) H⁻¹, and the intervals take Student's quantile for the
/// degrees of freedom in which the noise was seen. `effective` is the number of residuals that
/// count as independent; 0: all that are observed (not 0 with a Jacobian of 0). `huber` as in the
/// fit: errors are then those of Huber's estimator (Huber, Robust Statistics, ch. 7.6). With
/// `blocks` (Problem::blocks()) an error is at least what the blocks' disagreement about the value
/// makes it, H⁻¹ M H⁻¹ with M from the gradients of the blocks (Liang and Zeger 1986): under a
/// wrong law residuals are correlated in ways that no count of independent ones describes. What is
/// observable and the correlations stay those of the noise. `far`: the fit may have ended in a
/// wrong place, and statements say so before they say what to record. Throws Error(kInput) where
/// the sizes differ.
[[nodiscard]] Uncertainty uncertainty(const std::vector<Parameter>& parameters,
                                      const LeastSquaresState& state, double effective = 0.0,
                                      double huber = 0.0,
                                      const std::vector<std::uint32_t>& blocks = {},
                                      bool far = false);

/// Adds what the discretisation makes of the values, from the same simulation on a coarser grid:
/// `change` is what that adds to the residuals at the end of the fit, of which `share` is taken to
/// be in the fit as well (a third with a grid twice as coarse and errors of second order). The
/// values that would make up for the change, times the share, are the grid errors; the intervals
/// are widened by them. Most of a change no values make up for: it counts as noise of its own size,
/// and the values as known to their scales, so that a direction that hardly changes anything takes
/// no part. States which values the grid makes less certain than the data do.
void add_grid_error(const std::vector<Parameter>& parameters, const LeastSquaresState& state,
                    const Eigen::VectorXd& change, double share, double huber, Uncertainty& known);

}  // namespace matterfit::fit
