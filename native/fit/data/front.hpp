// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "base/vec.hpp"

namespace matterfit::fit {

/// The place of a body's front: how far its material reaches in a direction, as a surge or a heap
/// is measured. A mean over particles with weights that fall off from the foremost by e in half a
/// separation, and half a separation before it, where a foremost particle ends:
///   f = Σ w_i x_i·d + s/2,  w_i ∝ exp(2 x_i·d / s).
class Front {
 public:
  /// `direction` a unit vector; `separation` of the particles [m].
  Front(const Vec3d& direction, double separation)
      : direction_(direction), width_(0.5 * separation) {}

  /// How far the front reaches along the direction [m]; `positions` is not empty.
  [[nodiscard]] double reach(std::span<const Vec3d> positions) const;
  /// How fast that moves [m/s].
  [[nodiscard]] double speed(std::span<const Vec3d> positions,
                             std::span<const Vec3d> velocities) const;
  /// Adds `bar` times the derivative of reach() to the particles' cotangents.
  void spread(double bar, std::span<const Vec3d> positions, std::span<Vec3d> position_bars) const;
  /// `point` with its part along the direction replaced.
  [[nodiscard]] Vec3d moved(const Vec3d& point, double reach) const {
    return point + (reach - point.dot(direction_)) * direction_;
  }
  [[nodiscard]] const Vec3d& direction() const { return direction_; }

 private:
  /// Derivatives of reach() by each particle's x·d: their sum is 1.
  [[nodiscard]] std::vector<double> slopes(std::span<const Vec3d> positions, double& mean) const;

  Vec3d direction_;
  double width_;
};

}  // namespace matterfit::fit
