// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

namespace matterfit::job {

/// In steps: where differences of fourth order look.
inline constexpr std::array<double, 4> kFourthOrder = {-2.0, -1.0, 1.0, 2.0};

/// `start`, then for each number four points about it, a step `steps[k]` apart.
inline std::vector<Eigen::VectorXd> points_about(const Eigen::VectorXd& start,
                                                 const Eigen::VectorXd& steps) {
  std::vector<Eigen::VectorXd> points{start};
  for (Eigen::Index k = 0; k < start.size(); ++k) {
    for (const double s : kFourthOrder) {
      points.push_back(start);
      points.back()[k] += s * steps[k];
    }
  }
  return points;
}

/// Derivatives of wᵀr by each number, of residuals r at points_about().
inline Eigen::VectorXd slopes_of(const std::vector<std::optional<Eigen::VectorXd>>& residuals,
                                 const Eigen::VectorXd& w, const Eigen::VectorXd& steps) {
  Eigen::VectorXd slopes(steps.size());
  for (Eigen::Index k = 0; k < steps.size(); ++k) {
    const auto value = [&](std::size_t s) { return w.dot(*residuals[4 * std::size_t(k) + 1 + s]); };
    slopes[k] = (value(0) - 8.0 * value(1) + 8.0 * value(2) - value(3)) / (12.0 * steps[k]);
  }
  return slopes;
}

}  // namespace matterfit::job
