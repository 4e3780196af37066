// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/negligible.hpp"

#include <algorithm>

#include "fit/numerics/information.hpp"
#include "fit/numerics/quadratic_model.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// A step that moves nothing by more than this part of its standard error may be the last.
constexpr double kNothing = 0.1;
/// Errors are no measure far from the truth, where all that is missed makes them: at most this part
/// of a parameter's scale is nothing.
constexpr double kShort = 0.01;

}  // namespace

Negligible negligible(const Problem& problem, const std::vector<Parameter>& parameters,
                      const LeastSquaresOptions& options, const LeastSquaresState& state,
                      bool own) {
  constexpr double kFar = 2.0;  // times the noise: what is missed is not noise
  Negligible result{VectorXd::Zero(state.point.size()), options.cost_tolerance};
  const double independent = problem.effective(state.residual);
  if (!(independent > 0.0)) return result;
  if (mean_square(state) > kFar * kFar) {
    result.decrease = std::max(kLittle, result.decrease);
  }
  if (!own) return result;
  const Information known =
      information(parameters, state, independent, options.huber, problem.blocks());
  for (Index k = 0; k < state.point.size(); ++k) {
    result.moves[k] =
        std::min(kNothing * known.error[k], kShort * parameters[std::size_t(k)].scale);
  }
  return result;
}

double worth_while(const Problem& problem, const VectorXd& residual, double tolerance) {
  constexpr double kTenth = 0.01;
  constexpr double kMost = 1e-4;
  const double independent = residual.size() > 0 ? problem.effective(residual) : 0.0;
  return independent > 0.0 ? std::max(tolerance, std::min(kMost, kTenth / independent)) : tolerance;
}

bool stalled(const std::vector<LeastSquaresStep>& history, double least) {
  double later = -1.0;
  int iteration = 0;
  int gains = 0;
  for (auto step = history.rbegin(); step != history.rend() && gains < 2; ++step) {
    if (!step->accepted) continue;
    if (later >= 0.0) {
      // Where it stands still the costs are of one point, with other substeps.
      if (step->iteration + 1 != iteration || step->cost - later > least) return false;
      ++gains;
    }
    later = step->cost;
    iteration = step->iteration;
  }
  return gains == 2;
}

}  // namespace matterfit::fit
