// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

namespace matterfit::fit {

/// The coordinate in which a parameter is optimised: the one in which equal steps mean about
/// equally much, and in which its bounds lie at infinity where physics puts them there.
enum class Coordinate {
  kLinear,  ///< x: velocities, angles
  kLog,     ///< ln x: moduli, viscosities, yield stress, times, density
  kLogit,   ///< ln(x / (½ − x)): Poisson's ratio, in (0, ½)
};

/// What is known of a parameter beforehand, a normal distribution in the natural coordinate.
struct Prior {
  double mean = 0.0;   ///< natural coordinate
  double sigma = 1.0;  ///< natural coordinate, > 0
};

/// One number that a fit may move.
struct Parameter {
  std::string name;  ///< the JSON path, as "bodies.dough.material.E"; a component ends in "[0]"
  std::string unit;  ///< SI, for reports: "Pa", "m/s", or empty
  Coordinate coordinate = Coordinate::kLinear;
  double start = 0.0;  ///< physical
  double low = 0.0;  ///< physical; low < high, and 0 < low for kLog, 0 < low, high < ½ for kLogit
  double high = 0.0;
  double scale = 1.0;  ///< natural coordinate: a step that matters, for finite differences
  std::optional<Prior> prior;
  std::string words = "it";  ///< in a sentence: "the stiffness"
  /// Completes "To see it, record …".
  std::string record = "a motion that changes with it";
};

/// Throws Error(kInput), with the parameter's name, where start or bounds are outside what the
/// coordinate allows.
void check(const Parameter& parameter);
[[nodiscard]] double to_natural(Coordinate coordinate, double value);
[[nodiscard]] double from_natural(Coordinate coordinate, double natural);
/// The parameter's value at a natural coordinate, within its bounds.
[[nodiscard]] double value_within_bounds(const Parameter& parameter, double natural);
/// dx/dξ at the natural coordinate ξ: turns a standard error in ξ into one in x.
[[nodiscard]] double derivative(Coordinate coordinate, double natural);
/// A gradient by physical values as one by natural coordinates at `point`, one a parameter.
[[nodiscard]] Eigen::VectorXd natural_gradient(const std::vector<Parameter>& parameters,
                                               const Eigen::VectorXd& point,
                                               const std::vector<double>& physical);

}  // namespace matterfit::fit
