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

/// Whether an observation acts in a capture, by its number.
[[nodiscard]] bool acts_in(const Effect& effect, int capture);

/// How much later than `time` the moving thing is when it is seen [s]: `first` the capture's first
/// time, x where it is.
[[nodiscard]] double time_shift(const Observed& observed, double time, double first,
                                const Vec3d& x);

/// Where a thing was that was seen at x, `since` [s] after the first time: scale, roll, drift and
/// offset undone; x for others.
[[nodiscard]] Vec3d undone(const Observed& observed, double since, const Vec3d& x);

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
