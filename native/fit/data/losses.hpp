// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "base/vec.hpp"

namespace matterfit::fit {

/// How a simulation is compared with a recording.
enum class Loss {
  kTracks,   ///< point by point
  kChamfer,  ///< clouds of the body's particles
  kSurface,  ///< clouds of points on the body's surface at rest
};

/// Residuals (simulated − captured)/σ of tracks: three a sample, 0 where it is not visible or held
/// out. `sigma` [m] of each point. Throws Error(kInput) for a σ that is not above 0 or lengths that
/// differ.
[[nodiscard]] Eigen::VectorXd track_residuals(std::span<const Vec3d> simulated,
                                              std::span<const Vec3d> captured,
                                              std::span<const std::uint8_t> used,
                                              std::span<const double> sigma, std::size_t points);

}  // namespace matterfit::fit
