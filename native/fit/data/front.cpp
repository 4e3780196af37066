// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/front.hpp"

#include <algorithm>
#include <cmath>

namespace matterfit::fit {

std::vector<double> Front::slopes(std::span<const Vec3d> positions, double& mean) const {
  std::vector<double> along(positions.size());
  for (std::size_t i = 0; i < along.size(); ++i) along[i] = positions[i].dot(direction_);
  const double foremost = *std::ranges::max_element(along);
  std::vector<double> weights(along.size());
  double sum = 0.0;
  for (std::size_t i = 0; i < along.size(); ++i) {
    weights[i] = std::exp((along[i] - foremost) / width_);
    sum += weights[i];
  }
  mean = 0.0;
  for (std::size_t i = 0; i < along.size(); ++i) {
    weights[i] /= sum;
    mean += weights[i] * along[i];
  }
  for (std::size_t i = 0; i < along.size(); ++i) weights[i] *= 1.0 + (along[i] - mean) / width_;
  return weights;
}

double Front::reach(std::span<const Vec3d> positions) const {
  double mean = 0.0;
  (void)slopes(positions, mean);
  return mean + width_;
}

double Front::speed(std::span<const Vec3d> positions, std::span<const Vec3d> velocities) const {
  double mean = 0.0;
  const std::vector<double> by = slopes(positions, mean);
  double sum = 0.0;
  for (std::size_t i = 0; i < by.size(); ++i) sum += by[i] * velocities[i].dot(direction_);
  return sum;
}

void Front::spread(double bar, std::span<const Vec3d> positions,
                   std::span<Vec3d> position_bars) const {
  double mean = 0.0;
  const std::vector<double> by = slopes(positions, mean);
  for (std::size_t i = 0; i < by.size(); ++i) position_bars[i] += bar * by[i] * direction_;
}

}  // namespace matterfit::fit
