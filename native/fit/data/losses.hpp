// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"

namespace matterfit::fit {

/// By what a simulation is compared with a recording.
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

/// A loss with its gradient with respect to the simulated positions.
struct LossGradient {
  double value = 0.0;
  std::vector<Vec3d> gradient;
};

/// Mean over used samples of the L1 distance, or of Huber's function of the distance with threshold
/// `huber` [m] where that is above 0 (physics: L_traj): [m], with Huber's [m²]. Throws
/// Error(kInput) where no sample is used.
[[nodiscard]] LossGradient trajectory_loss(std::span<const Vec3d> simulated,
                                           std::span<const Vec3d> captured,
                                           std::span<const std::uint8_t> used, double huber = 0.0);

/// Chamfer distance [m²] between simulated points and a captured cloud, mean squared nearest
/// distance, both ways summed, with its gradient at the present nearest neighbours. Same result for
/// any number of threads. Captured points that are not finite are left out; the value is not a
/// number where a simulated one is not finite. Throws Error(kInput) if a set is empty.
[[nodiscard]] LossGradient chamfer_loss(std::span<const Vec3d> simulated,
                                        std::span<const Vec3d> captured, Arena& arena);

}  // namespace matterfit::fit
