// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "fit/numerics/bounded_step.hpp"
#include "fit/numerics/least_squares.hpp"
#include "fit/numerics/parameter.hpp"

namespace matterfit::fit {

/// Where a search stands; thrown as Error(kCompute).
inline constexpr const char* kNotCompleted =
    "the simulation could not be completed at the values that the search has come to. Give other "
    "start values or narrower bounds, or a lower solver.dt_safety.";

/// Residuals at the points; nothing for a point that failed or has an entry that is not finite.
/// `rows`: how many residuals are expected, 0: as many as the first point has. Throws
/// Error(kCompute) where the number differs, Error(kInput) where there is none.
[[nodiscard]] std::vector<std::optional<Eigen::VectorXd>> evaluate(
    Problem& problem, const std::vector<Eigen::VectorXd>& points, Eigen::Index rows);

struct Differences {
  Eigen::VectorXd residual;           ///< at the point itself
  Eigen::MatrixXd jacobian;           ///< residuals × parameters
  std::vector<std::uint8_t> unknown;  ///< 1: no evaluation beside the point succeeded; column 0
  int evaluations = 0;
};

/// Finite differences of the residuals at `point`, `step` × Parameter::scale wide, within `bounds`
/// (natural coordinates): forward, backward where the upper bound is nearer than the step, central
/// on request where there is room. Where evaluations fail the other side is tried, then shorter
/// steps. All that can be evaluated side by side is. `residual` empty: evaluated too; throws
/// Error(kCompute) if that fails.
[[nodiscard]] Differences differences(Problem& problem, const std::vector<Parameter>& parameters,
                                      const Box& bounds, const Eigen::VectorXd& point,
                                      const Eigen::VectorXd& residual, double step, bool central);

}  // namespace matterfit::fit
