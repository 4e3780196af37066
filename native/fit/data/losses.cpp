// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/losses.hpp"

#include <cmath>
#include <string>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

void require_samples(std::span<const Vec3d> simulated, std::span<const Vec3d> captured,
                     std::span<const std::uint8_t> used) {
  if (simulated.size() != captured.size() || simulated.size() != used.size()) {
    throw_input("a loss of tracks has " + std::to_string(simulated.size()) +
                " simulated positions, " + std::to_string(captured.size()) + " captured and " +
                std::to_string(used.size()) + " marks of use; expected equal numbers.");
  }
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i] != 0 && !captured[i].allFinite()) {
      throw_input("a loss of tracks: sample " + std::to_string(i) +
                  " is used and its captured position is not finite. Mark it as not visible.");
    }
  }
}

}  // namespace

Eigen::VectorXd track_residuals(std::span<const Vec3d> simulated, std::span<const Vec3d> captured,
                                std::span<const std::uint8_t> used, std::span<const double> sigma,
                                std::size_t points) {
  require_samples(simulated, captured, used);
  if (points == 0 || sigma.size() != points || simulated.size() % points != 0) {
    throw_input("a loss of tracks has " + std::to_string(simulated.size()) + " samples of " +
                std::to_string(points) + " points and " + std::to_string(sigma.size()) +
                " noise levels; expected one noise level a point and whole frames.");
  }
  Eigen::VectorXd residual = Eigen::VectorXd::Zero(Eigen::Index(3 * simulated.size()));
  for (std::size_t i = 0; i < simulated.size(); ++i) {
    if (used[i] == 0) continue;
    const double noise = sigma[i % points];
    if (!(noise > 0.0) || !std::isfinite(noise)) {
      throw_input("a loss of tracks: the noise of point " + std::to_string(i % points) + " is " +
                  std::to_string(noise) + " m; expected a length above 0.");
    }
    residual.segment<3>(Eigen::Index(3 * i)) = (simulated[i] - captured[i]) / noise;
  }
  return residual;
}

}  // namespace matterfit::fit
