// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>

namespace matterfit::fit {

/// The point, among those that a stage's iterations began at, that missed least with the substeps
/// that the solver takes there. An iteration compares its runs with the substeps of the point that
/// it begins at, and the next one begins with those of its own: of flows, whose motion depends on
/// the substep, a stiffer point may gain with the one and lose more with the other.
struct Nearest {
  double cost = 0.0;
  Eigen::VectorXd point;  ///< natural coordinates
  int worse = 0;          ///< iterations since then that began clearly farther off
};

/// Takes down what an iteration began with. True where several have begun clearly farther off than
/// the nearest, so that further steps lead nowhere.
[[nodiscard]] bool leads_astray(std::optional<Nearest>& nearest, double cost,
                                const Eigen::VectorXd& point);

}  // namespace matterfit::fit
