// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/slopes.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.hpp"
#include "fit/numerics/differences.hpp"
#include "fit/numerics/quadratic_model.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A derivative that misses the Jacobian's by more than this part of the longest that a column may
/// have is none: kinks, or a simulation that is not smooth.
constexpr double kPlausible = 0.5;

/// Residuals as the cost's gradient weighs them: beyond Huber's threshold they count by their sign.
VectorXd weighed(const VectorXd& residual, double huber) {
  if (!(huber > 0.0)) return residual;
  return residual.cwiseMax(-huber).cwiseMin(huber);
}

}  // namespace

void bring_up_to_date(const std::vector<Parameter>& parameters, const VectorXd& step,
                      const VectorXd& change, MatrixXd& jacobian) {
  VectorXd scaled = step;
  for (Index k = 0; k < step.size(); ++k) {
    scaled[k] /= parameters[std::size_t(k)].scale * parameters[std::size_t(k)].scale;
  }
  const double length = step.dot(scaled);
  if (!(length > 0.0)) return;
  VectorXd missed = change;
  for (Index k = 0; k < step.size(); ++k) missed -= step[k] * jacobian.col(k);
  for (Index k = 0; k < step.size(); ++k) jacobian.col(k) += (scaled[k] / length) * missed;
}

bool correct(Problem& problem, const VectorXd& point, const VectorXd& residual, double huber,
             const std::vector<std::uint8_t>& unknown, MatrixXd& jacobian) {
  const VectorXd weights = weighed(residual, huber);
  const double length = weights.squaredNorm();
  if (!(length > 0.0)) return false;
  const auto exact = problem.transposed(point, weights);
  if (!exact || exact->size() != jacobian.cols() || !exact->allFinite()) return false;
  VectorXd missed = VectorXd::Zero(jacobian.cols());
  for (Index k = 0; k < jacobian.cols(); ++k) {
    if (unknown[std::size_t(k)] != 0) continue;
    missed[k] = (*exact)[k] - jacobian.col(k).dot(weights);
    const double longest = jacobian.col(k).norm() * std::sqrt(length);
    if (std::abs(missed[k]) > kPlausible * longest) return false;
  }
  for (Index k = 0; k < jacobian.cols(); ++k) jacobian.col(k) += (missed[k] / length) * weights;
  return true;
}

void linearise_at(Problem& problem, const std::vector<Parameter>& parameters,
                  const LeastSquaresOptions& options, Slopes slopes, LeastSquaresState& state) {
  const Box bounds = natural_bounds(parameters);
  const bool fresh = state.residual.size() == 0;
  const bool central = slopes == Slopes::kCentral || (slopes == Slopes::kKept && state.central);
  const auto take = [&](Differences found, bool with_residual) {
    state.evaluations += found.evaluations;
    if (with_residual) state.residual = std::move(found.residual);
    state.jacobian = std::move(found.jacobian);
    state.unknown = std::move(found.unknown);
  };
  const auto differ = [&](Problem& of, const VectorXd& point, const VectorXd& residual) {
    return differences(of, parameters, bounds, point, residual, options.difference, central);
  };
  if (slopes == Slopes::kStandIn) {
    if (fresh) {
      auto result = evaluate(problem, {state.point}, 0);
      ++state.evaluations;
      if (!result.front()) {
        throw_compute(kNotCompleted);
      }
      state.residual = std::move(*result.front());
    }
    take(differ(*problem.stand_in(), state.point, {}), false);
    if (state.jacobian.rows() != state.residual.size()) {
      throw_compute("the stand-in of a fit has another number of residuals.");
    }
  } else if (slopes == Slopes::kKept) {
    if (state.jacobian.size() == 0) {
      // Counted when it was first made.
      Differences found = differ(problem, state.anchor, {});
      int passed = 0;
      const auto corrected = [&](const VectorXd& at) {
        const auto& where = state.corrected;
        if (std::find(where.begin(), where.end(), passed++) == where.end()) return;
        if (!correct(problem, at, found.residual, options.huber, found.unknown, found.jacobian)) {
          throw_compute("a fit that goes on meets another simulation.");
        }
      };
      corrected(state.anchor);
      const VectorXd* from = &state.anchor;
      for (const VectorXd& to : state.trail) {
        auto residual = evaluate(problem, {to}, found.residual.size());
        if (!residual.front()) throw_compute("a fit that goes on meets another simulation.");
        bring_up_to_date(parameters, to - *from, *residual.front() - found.residual,
                         found.jacobian);
        found.residual = std::move(*residual.front());
        corrected(to);
        from = &to;
      }
      state.jacobian = std::move(found.jacobian);
      state.unknown = std::move(found.unknown);
    }
  } else {
    take(differ(problem, state.point, state.residual), true);
  }
  if (!fresh) return;
  state.cost = cost_of(parameters, state.point, state.residual, options.huber);
  if (!std::isfinite(state.cost)) {
    throw_compute(
        "the residuals are too large at the values that the search has come to. Give other start "
        "values.");
  }
  state.history.push_back({state.iteration, state.cost, state.damping, true});
}

}  // namespace matterfit::fit
