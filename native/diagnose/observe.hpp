// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "diagnose/model.hpp"

namespace matterfit::diagnose {

/// An observation at work.
struct Observed {
  const Effect* effect = nullptr;
  Eigen::VectorXd values;  ///< physical, one a number
};

/// Velocities [m/s] of all rows: the motion's own, or differences between frames (three points,
/// second order; one-sided at the ends; 0 with a single frame).
[[nodiscard]] Eigen::VectorXd velocities(const Motion& motion,
                                         const std::vector<Capture>& captures);

/// What cameras would have recorded of the motion [m], with the observations applied in order:
/// lens, roll, scale, drift and offset act on positions; times are shifted first. Between frames
/// the motion is the cubic through positions and velocities (Hermite), beyond the first and last
/// it goes on with the velocity and the mean acceleration of the nearest interval.
[[nodiscard]] Eigen::VectorXd observe(const Motion& motion, const std::vector<Capture>& captures,
                                      std::span<const Observed> observations);

}  // namespace matterfit::diagnose
