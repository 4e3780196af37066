// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/parameter.hpp"

/// What a search does not go on for: steps that gain next to nothing by what the data know.
namespace matterfit::fit {

/// A step that moves nothing (Negligible::moves_nothing()) and lowers the cost by no more than this
/// part of it is the last: what a wrong law misses has many such steps in store.
inline constexpr double kLittle = 0.01;

/// What a search does not go on for.
struct Negligible {
  Eigen::VectorXd moves;  ///< of each parameter; 0 where that is not known
  double decrease = 0.0;  ///< relative, of the last two steps
  [[nodiscard]] bool moves_nothing(const Eigen::VectorXd& step) const {
    return (step.cwiseAbs().array() <= moves.array()).all();
  }
};

/// At the state's point. `own`: the Jacobian is the problem's own. Where it is not known how many
/// residuals are independent nothing is negligible but what LeastSquaresOptions say.
[[nodiscard]] Negligible negligible(const Problem& problem,
                                    const std::vector<Parameter>& parameters,
                                    const LeastSquaresOptions& options,
                                    const LeastSquaresState& state, bool own);

/// The relative decrease by which parameters move a tenth of their standard errors: (δ/s.e.)²/N. At
/// least `tolerance`.
[[nodiscard]] double worth_while(const Problem& problem, const Eigen::VectorXd& residual,
                                 double tolerance);

/// Whether the step before the one just taken, too, lowered the cost by less than `least`: in a
/// crooked valley, or where differences are rough, the model goes on promising more than there is.
[[nodiscard]] bool stalled(const std::vector<LeastSquaresStep>& history, double least);

}  // namespace matterfit::fit
