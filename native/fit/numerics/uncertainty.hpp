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

/// What information() knows, in physical values, with what is said of it. Its arguments; `far`: the
/// fit may have ended in a wrong place, and statements say so before they say what to record.
[[nodiscard]] Uncertainty uncertainty(const std::vector<Parameter>& parameters,
                                      const LeastSquaresState& state, double effective = 0.0,
                                      double huber = 0.0,
                                      const std::vector<std::uint32_t>& blocks = {},
                                      bool far = false);

/// Adds what the discretisation makes of the values (grid_shift(), whose arguments these are): the
/// intervals are widened by it. States which values the grid makes less certain than the data do.
void add_grid_error(const std::vector<Parameter>& parameters, const LeastSquaresState& state,
                    const Eigen::VectorXd& change, double share, double huber, Uncertainty& known);

}  // namespace matterfit::fit
