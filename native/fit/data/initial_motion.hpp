// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include "base/vec.hpp"

namespace matterfit::fit {

/// Rigid motion of a body at time 0, that of its rest positions.
struct InitialMotion {
  Vec3d velocity = Vec3d::Zero();  ///< of the centre of mass [m/s]
  Vec3d spin = Vec3d::Zero();      ///< about world axes through it [rad/s]
  Vec3d offset = Vec3d::Zero();    ///< of the centre of mass against rest [m]
  Vec3d rotation = Vec3d::Zero();  ///< against rest, a rotation vector about the centre [rad]
  double residual = 0.0;           ///< root mean square distance left over [m]
  bool spin_observable = true;     ///< false where all points lie near one line, or there is one
};

/// From the frames before anything touches: each frame's rigid placement against `rest` (Kabsch)
/// gives a start in closed form, the spin from the turns between frames; then
/// least squares over all seen points of x(t) = c + v t + ½ g t² + exp(ω t) R (rest − center), so
/// that frames in which few points are seen count too. The spin is taken to be constant, and below
/// half a turn between frames in which three points are seen. For points on a line the spin about
/// it is 0, for one point all spin. `times` [s] after the rest state, ascending; `positions`
/// (frames × points), not finite where not seen; `center` of mass at rest; `gravity` [m/s²]. Throws
/// Error(kInput) with fewer than two frames or without a point seen in two.
[[nodiscard]] InitialMotion initial_motion(std::span<const Vec3d> rest, const Vec3d& center,
                                           std::span<const double> times,
                                           std::span<const Vec3d> positions, const Vec3d& gravity);

}  // namespace matterfit::fit
