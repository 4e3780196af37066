// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/differences.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Steps after a failure, relative to the first.
constexpr std::array kShorter{1.0, 0.25, 0.0625};

/// One evaluation beside the point.
struct Probe {
  std::size_t parameter = 0;
  double step = 0.0;  ///< natural coordinate, as it is after rounding
};

/// The steps to try for one parameter, in order.
std::vector<double> candidates(double at, double low, double high, double step) {
  std::vector<double> steps;
  for (const double factor : kShorter) {
    const double h = factor * step;
    const double up = high - at;
    const double down = at - low;
    if (up >= h) steps.push_back(h);
    if (down >= h) steps.push_back(-h);
    if (up < h && down < h) steps.push_back(up >= down ? up : -down);
  }
  return steps;
}

}  // namespace

std::vector<std::optional<VectorXd>> evaluate(Problem& problem, const std::vector<VectorXd>& points,
                                              Index rows) {
  if (points.empty()) return {};
  std::vector<std::optional<VectorXd>> results = problem.evaluate(points);
  if (results.size() != points.size()) {
    throw_compute("the fit asked for the residuals of " + std::to_string(points.size()) +
                  " points and got " + std::to_string(results.size()) + ".");
  }
  for (std::optional<VectorXd>& result : results) {
    if (!result) continue;
    if (result->size() == 0) throw_input("the fit has nothing to compare with: no residual.");
    if (rows == 0) rows = result->size();
    if (result->size() != rows) {
      throw_compute("the fit expected " + std::to_string(rows) + " residuals and got " +
                    std::to_string(result->size()) + ".");
    }
    if (!result->allFinite()) result.reset();
  }
  return results;
}

Differences differences(Problem& problem, const std::vector<Parameter>& parameters,
                        const Box& bounds, const VectorXd& point, const VectorXd& residual,
                        double step, bool central) {
  const std::size_t n = parameters.size();
  Differences result;
  result.residual = residual;
  result.unknown.assign(n, 1);

  std::vector<std::vector<double>> steps(n);
  std::vector<std::size_t> tried(n, 0);
  for (std::size_t k = 0; k < n; ++k) {
    const auto i = Index(k);
    steps[k] = candidates(point[i], bounds.low[i], bounds.high[i], step * parameters[k].scale);
  }
  // The residuals of the probes that succeeded, one or two a parameter.
  std::vector<std::vector<std::pair<double, VectorXd>>> found(n);
  for (bool first = true;; first = false) {
    std::vector<VectorXd> points;
    std::vector<Probe> probes;
    const bool with_base = result.residual.size() == 0;
    if (with_base) points.push_back(point);
    for (std::size_t k = 0; k < n; ++k) {
      if (!found[k].empty()) continue;
      const bool both = central && first && steps[k].size() > 1 && steps[k][0] == -steps[k][1];
      for (int side = 0; side < (both ? 2 : 1) && tried[k] < steps[k].size(); ++side) {
        VectorXd beside = point;
        const auto i = Index(k);
        beside[i] = std::clamp(point[i] + steps[k][tried[k]++], bounds.low[i], bounds.high[i]);
        probes.push_back({k, beside[i] - point[i]});
        points.push_back(std::move(beside));
      }
    }
    if (points.empty()) break;
    auto evaluated = evaluate(problem, points, result.residual.size());
    result.evaluations += int(points.size());
    if (with_base) {
      if (!evaluated.front()) {
        throw_compute(kNotCompleted);
      }
      result.residual = std::move(*evaluated.front());
    }
    for (std::size_t i = 0; i < probes.size(); ++i) {
      auto& at = evaluated[i + (with_base ? 1U : 0U)];
      if (at) found[probes[i].parameter].emplace_back(probes[i].step, std::move(*at));
    }
  }

  result.jacobian = MatrixXd::Zero(result.residual.size(), Index(n));
  for (std::size_t k = 0; k < n; ++k) {
    if (found[k].empty()) continue;
    result.unknown[k] = 0;
    const auto& [h, ahead] = found[k][0];
    if (found[k].size() == 2) {
      const auto& [back, behind] = found[k][1];
      result.jacobian.col(Index(k)) = (ahead - behind) / (h - back);
    } else {
      result.jacobian.col(Index(k)) = (ahead - result.residual) / h;
    }
  }
  return result;
}

}  // namespace matterfit::fit
