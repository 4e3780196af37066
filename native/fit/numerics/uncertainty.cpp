// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/uncertainty.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "fit/numerics/information.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kStrong = 0.95;  // correlation worth a statement
constexpr double kMisfit = 2.0;   // noise scale worth a statement

/// Sets the interval from the error in natural coordinates.
void set_interval(const Parameter& parameter, double at, double error, Estimate& estimate) {
  const double half = estimate.quantile * error;
  estimate.low = value_within_bounds(parameter, at - half);
  estimate.high = value_within_bounds(parameter, at + half);
}

std::string capital(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = char(text[0] - 'a' + 'A');
  return text;
}

std::string listed(const std::vector<Parameter>& parameters, const std::vector<Index>& members) {
  std::string text;
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (i > 0) text += i + 1 == members.size() ? " and " : ", ";
    text += parameters[std::size_t(members[i])].name;
  }
  return text;
}

/// How well a value is known that is not known well.
std::string range(const Parameter& parameter, const Estimate& estimate) {
  const std::string unit = parameter.unit.empty() ? "" : " " + parameter.unit;
  return fmt::format("between {:.3g} and {:.3g}{} (95 %)", estimate.low, estimate.high, unit);
}

std::string statement_of(const Parameter& parameter, const Estimate& estimate, bool sensitive,
                         bool unknown, bool far) {
  const std::string see =
      far ? " That holds where the search ended, which is far from the capture: if it is a wrong "
            "place, begin from other values. Else record " +
                parameter.record + "."
          : " To see it, record " + parameter.record + ".";
  const std::string subject = capital(parameter.words) + " (" + parameter.name + ")";
  if (unknown) {
    return subject +
           " could not be examined: the simulation could not be completed for values beside it.";
  }
  const std::string prior = parameter.prior ? " Its value is that of its prior." : "";
  if (!sensitive) {
    return subject + " is not observable: nothing that was compared changes with it." + prior + see;
  }
  if (!estimate.observable) {
    if (parameter.prior) {
      return subject +
             " is hardly observable: the data say less about it than its prior does; it "
             "lies " +
             range(parameter, estimate) + "." + see;
    }
    if (std::isinf(estimate.standard_error)) {
      return subject +
             " is not observable by itself: only a combination with other parameters is. "
             "Fix one of them, give it a prior, or record " +
             parameter.record + ".";
    }
    return subject + " is not observable well: it lies " + range(parameter, estimate) +
           ", and within that the simulation changes by no more than the noise." + see;
  }
  if (estimate.at_bound) {
    return subject + fmt::format(
                         " ended at its bound {:.4g}. Widen the bounds if a value beyond is "
                         "possible; otherwise something else in the scene is wrong.",
                         estimate.value);
  }
  return "";
}

std::vector<std::string> general(const std::vector<Parameter>& parameters,
                                 const Information& known) {
  std::vector<std::string> statements;
  const auto n = Index(parameters.size());
  MatrixXd told = MatrixXd::Zero(n, n);
  const auto has_prior = [&](Index k) { return parameters[std::size_t(k)].prior.has_value(); };
  for (const std::vector<Index>& members : known.unseen) {
    statements.push_back("Only a combination of " + listed(parameters, members) + " is observed. " +
                         (std::ranges::all_of(members, has_prior)
                              ? "Their priors decide what each of them is."
                              : "Fix one of them or give it a prior."));
    for (const Index a : members) {
      for (const Index b : members) told(a, b) = 1.0;
    }
  }
  for (Index i = 0; i < n; ++i) {
    for (Index j = i + 1; j < n; ++j) {
      const double c = known.correlation(i, j);
      if (std::abs(c) < kStrong || told(i, j) != 0.0) continue;
      statements.push_back(fmt::format(
          "{} and {} are hard to distinguish (correlation {:.3f}): {}, and little changes. Fix one "
          "of them or give it a prior.",
          parameters[std::size_t(i)].name, parameters[std::size_t(j)].name, c,
          c > 0.0 ? "raise both" : "raise one and lower the other"));
    }
  }
  if (!known.judged) {
    statements.emplace_back(
        "There are not more independent observations than parameters: how well the law fits cannot "
        "be judged, and errors are those of the stated noise.");
  } else if (known.noise_scale > kMisfit) {
    statements.push_back(fmt::format(
        "The simulation misses the capture by {:.3g} times the stated noise: the law or "
        "the scene lacks something, or the noise is larger. Errors are enlarged by it{}.",
        known.noise_scale,
        known.smooth ? ", and rough: what is missed is so smooth that it is hardly more than one "
                       "observation for each parameter"
                     : ""));
  } else if (known.noise_scale < 1.0 / kMisfit) {
    statements.push_back(fmt::format(
        "The simulation meets the capture to {:.3g} of the noise that is counted (of clouds the "
        "spacing of their points is counted too): it is smaller, and the errors may be too.",
        known.noise_scale));
  }
  return statements;
}

}  // namespace

Uncertainty uncertainty(const std::vector<Parameter>& parameters, const LeastSquaresState& state,
                        double effective, double huber, const std::vector<std::uint32_t>& blocks,
                        bool far) {
  const Information known = information(parameters, state, effective, huber, blocks);
  Uncertainty result;
  result.correlation = known.correlation;
  result.noise_scale = known.noise_scale;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const Parameter& parameter = parameters[k];
    const double at = state.point[Index(k)];
    const double error = known.error[Index(k)];
    Estimate estimate;
    estimate.value = value_within_bounds(parameter, at);
    estimate.standard_error = error * derivative(parameter.coordinate, at);
    estimate.quantile = known.quantile[Index(k)];
    set_interval(parameter, at, error, estimate);
    const double near = 1e-6 * parameter.scale;
    estimate.at_bound = at - to_natural(parameter.coordinate, parameter.low) <= near ||
                        to_natural(parameter.coordinate, parameter.high) - at <= near;
    const double expected =
        parameter.prior ? parameter.prior->sigma / std::sqrt(2.0) : parameter.scale;
    estimate.observable = known.narrowed[Index(k)] < expected;
    const bool unknown = k < state.unknown.size() && state.unknown[k] != 0;
    estimate.statement = statement_of(parameter, estimate, known.sensitive[k], unknown, far);
    result.estimates.push_back(std::move(estimate));
  }
  result.statements = general(parameters, known);
  if (!known.disagreed.empty()) {
    result.statements.push_back(
        "Parts of the capture ask for different values of " + listed(parameters, known.disagreed) +
        ", by more than the noise explains: the law or the scene lacks something. Errors are "
        "enlarged by it.");
  }
  return result;
}

void add_grid_error(const std::vector<Parameter>& parameters, const LeastSquaresState& state,
                    const VectorXd& change, double share, double huber, Uncertainty& known) {
  if (known.estimates.size() != parameters.size()) {
    throw_input("the grid error of a fit needs an estimate of each parameter.");
  }
  const VectorXd shift = grid_shift(parameters, state, change, share, huber);
  if (shift.isZero(0.0)) return;
  std::vector<Index> uncertain;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    Estimate& estimate = known.estimates[k];
    if (!std::isfinite(estimate.standard_error)) continue;
    const double at = state.point[Index(k)];
    const double moved = shift[Index(k)];
    const double slope = derivative(parameters[k].coordinate, at);
    const double error = estimate.standard_error / slope;
    estimate.grid_error = std::abs(moved) * slope;
    set_interval(parameters[k], at, std::hypot(error, moved), estimate);
    if (std::abs(moved) > error) uncertain.push_back(Index(k));
  }
  if (uncertain.empty()) return;
  known.statements.push_back(
      "The grid makes " + listed(parameters, uncertain) +
      " less certain than the data do: on a coarser grid other values would fit best. Use a "
      "smaller particle separation to know more.");
}

}  // namespace matterfit::fit
