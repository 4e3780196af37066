// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>

#include "base/vec.hpp"

namespace matterfit::effects {

/// The share (1 − q²)³, q = |d|/r, by which an effect fades with the way d [m] from its place; 0
/// from the radius r [m] on, smooth to the second derivative there.
struct Fade {
  Vec3d away;
  double radius;
  double left;  ///< 1 − q², 0 outside

  Fade(const Vec3d& away, double radius)
      : away(away),
        radius(radius),
        left(std::max(0.0, 1.0 - away.squaredNorm() / (radius * radius))) {}

  [[nodiscard]] double share() const { return left * left * left; }

  struct Bar {
    Vec3d away;
    double radius;
  };
  /// The derivatives of a number by d and r, from its derivative by the share.
  [[nodiscard]] Bar adjoint(double share_bar) const {
    const double square_bar = -3.0 * left * left * share_bar;  // by q²
    return {2.0 / (radius * radius) * square_bar * away,
            -2.0 * away.squaredNorm() / (radius * radius * radius) * square_bar};
  }
};

}  // namespace matterfit::effects
