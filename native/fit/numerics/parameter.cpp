// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/parameter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

/// Relative distance by which a start may lie outside a bound: a value that was clamped to it in
/// the natural coordinate comes back with a rounding error.
constexpr double kRounding = 1e-9;

}  // namespace

void check(const Parameter& parameter) {
  const auto& [name, unit, coordinate, start, low, high, scale, prior, words, record] = parameter;
  if (!std::isfinite(low) || !std::isfinite(high) || !(low < high)) {
    throw_input(fmt::format(
        "{}: its bounds are [{:g}, {:g}]; expected two finite numbers, the lower first.", name, low,
        high));
  }
  if (coordinate == Coordinate::kLog && !(low > 0.0)) {
    throw_input(fmt::format(
        "{}: its lower bound is {:g}, and it is fitted by its logarithm. Give a bound above 0.",
        name, low));
  }
  if (coordinate == Coordinate::kLogit && !(low > 0.0 && high < 0.5)) {
    throw_input(
        fmt::format("{}: its bounds are [{:g}, {:g}]; expected bounds strictly between 0 and 0.5.",
                    name, low, high));
  }
  const bool inside =
      start >= low - kRounding * std::abs(low) && start <= high + kRounding * std::abs(high);
  if (!inside) {
    throw_input(
        fmt::format("{}: its start is {:g}, outside its bounds [{:g}, {:g}]. Move the start or "
                    "widen the bounds.",
                    name, start, low, high));
  }
  if (!(scale > 0.0) || !std::isfinite(scale)) {
    throw_input(
        fmt::format("{}: its scale is {:g}; expected a finite number above 0.", name, scale));
  }
  if (prior &&
      (!(prior->sigma > 0.0) || !std::isfinite(prior->sigma) || !std::isfinite(prior->mean))) {
    throw_input(fmt::format(
        "{}: its prior has mean {:g} and sigma {:g}; expected a finite mean and a sigma above 0.",
        name, prior->mean, prior->sigma));
  }
}

double to_natural(Coordinate coordinate, double value) {
  switch (coordinate) {
    case Coordinate::kLog:
      return std::log(value);
    case Coordinate::kLogit:
      return std::log(value / (0.5 - value));
    case Coordinate::kLinear:
      break;
  }
  return value;
}

double from_natural(Coordinate coordinate, double natural) {
  switch (coordinate) {
    case Coordinate::kLog:
      return std::exp(natural);
    case Coordinate::kLogit:
      return 0.5 / (1.0 + std::exp(-natural));
    case Coordinate::kLinear:
      break;
  }
  return natural;
}

double value_within_bounds(const Parameter& parameter, double natural) {
  return std::clamp(from_natural(parameter.coordinate, natural), parameter.low, parameter.high);
}

double derivative(Coordinate coordinate, double natural) {
  switch (coordinate) {
    case Coordinate::kLog:
      return std::exp(natural);
    case Coordinate::kLogit:
      return 0.5 / (1.0 + std::exp(-natural)) / (1.0 + std::exp(natural));
    case Coordinate::kLinear:
      break;
  }
  return 1.0;
}

Eigen::VectorXd natural_gradient(const std::vector<Parameter>& parameters,
                                 const Eigen::VectorXd& point,
                                 const std::vector<double>& physical) {
  Eigen::VectorXd result(point.size());
  for (Eigen::Index k = 0; k < point.size(); ++k) {
    const auto n = std::size_t(k);
    result[k] = physical[n] * derivative(parameters[n].coordinate, point[k]);
  }
  return result;
}

}  // namespace matterfit::fit
