// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/losses.hpp"

#include <cmath>
#include <limits>
#include <string>

#include "base/error.hpp"
#include "fit/data/nearest.hpp"

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

Points finite(std::span<const Vec3d> points) {
  Points kept;
  for (const Vec3d& x : points) {
    if (x.allFinite()) kept.push_back(x);
  }
  return kept;
}

/// Both sets and the nearest neighbours of each in the other.
struct Pairing {
  Pairing(std::span<const Vec3d> simulated_points, std::span<const Vec3d> captured_points,
          Arena& arena)
      : simulated(finite(simulated_points)), captured(finite(captured_points)) {
    if (captured.empty()) {
      throw_input("a Chamfer loss: no captured point is finite.");
    }
    if (simulated_points.empty()) {
      throw_input("a Chamfer loss: there is no simulated point.");
    }
    broken = simulated.size() != simulated_points.size();
    if (broken) return;
    of_simulated = nearest(simulated, captured, arena);
    of_captured = nearest(captured, simulated, arena);
  }
  Points simulated;
  Points captured;
  std::vector<Nearest> of_simulated;
  std::vector<Nearest> of_captured;
  bool broken = false;  ///< a simulated point is not finite, so the loss is not a number
};

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

LossGradient trajectory_loss(std::span<const Vec3d> simulated, std::span<const Vec3d> captured,
                             std::span<const std::uint8_t> used, double huber) {
  require_samples(simulated, captured, used);
  if (!(huber >= 0.0)) {
    throw_input("a loss of tracks: the Huber threshold is " + std::to_string(huber) +
                " m; expected a length, or 0 for the L1 distance.");
  }
  std::size_t count = 0;
  for (const std::uint8_t use : used) count += use != 0 ? 1U : 0U;
  if (count == 0) throw_input("a loss of tracks: no sample is used.");
  LossGradient loss;
  loss.gradient.assign(simulated.size(), Vec3d::Zero());
  const double weight = 1.0 / double(count);
  for (std::size_t i = 0; i < simulated.size(); ++i) {
    if (used[i] == 0) continue;
    const Vec3d difference = simulated[i] - captured[i];
    if (huber == 0.0) {
      loss.value += weight * difference.lpNorm<1>();
      loss.gradient[i] = weight * difference.cwiseSign();
      continue;
    }
    const double distance = difference.norm();
    if (distance > huber) {
      loss.value += weight * huber * (distance - 0.5 * huber);
      loss.gradient[i] = weight * huber / distance * difference;
    } else {
      loss.value += weight * 0.5 * distance * distance;
      loss.gradient[i] = weight * difference;
    }
  }
  return loss;
}

LossGradient chamfer_loss(std::span<const Vec3d> simulated, std::span<const Vec3d> captured,
                          Arena& arena) {
  const Pairing pairing(simulated, captured, arena);
  LossGradient loss;
  loss.gradient.assign(simulated.size(), Vec3d::Zero());
  if (pairing.broken) {
    loss.value = std::numeric_limits<double>::quiet_NaN();
    return loss;
  }
  const Points& a = pairing.simulated;
  const Points& b = pairing.captured;
  double forth = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Nearest& neighbour = pairing.of_simulated[i];
    forth += neighbour.squared;
    loss.gradient[i] += 2.0 / double(a.size()) * (a[i] - b[neighbour.index]);
  }
  double back = 0.0;
  for (std::size_t j = 0; j < b.size(); ++j) {
    const Nearest& neighbour = pairing.of_captured[j];
    back += neighbour.squared;
    loss.gradient[neighbour.index] += 2.0 / double(b.size()) * (a[neighbour.index] - b[j]);
  }
  loss.value = forth / double(a.size()) + back / double(b.size());
  return loss;
}

}  // namespace matterfit::fit
