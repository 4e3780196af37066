// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/latent_network.hpp"

#include <cmath>

namespace matterfit::material {
namespace {

/// Inputs brought to the size of one.
constexpr double kVolumeMiddle = 3.0;
constexpr double kVolumeWidth = 3.5;
constexpr double kCurveWidth = 1.5;

constexpr std::size_t kOutputRow = kLatentHidden + 3;

/// Where the weights of an output begin.
constexpr std::size_t output_at(std::size_t k) { return 3 * kLatentHidden + k * kOutputRow; }

struct Activations {
  double u, v;
  std::array<double, kLatentHidden> hidden;
};

Activations activate(const LatentNetwork& network, double volume, double curve) {
  Activations a;
  a.u = (volume - kVolumeMiddle) / kVolumeWidth;
  a.v = curve / kCurveWidth;
  for (std::size_t i = 0; i < kLatentHidden; ++i) {
    const double* w = network.data() + 3 * i;
    a.hidden[i] = std::tanh(w[0] + w[1] * a.u + w[2] * a.v);
  }
  return a;
}

}  // namespace

LatentOutput latent_output(const LatentNetwork& network, double volume, double curve) {
  const Activations a = activate(network, volume, curve);
  LatentOutput out{};
  for (std::size_t k = 0; k < kIsotropicElastic; ++k) {
    const double* w = network.data() + output_at(k);
    double value = w[0] + w[1] * a.u + w[2] * a.v;
    double by_u = w[1];
    double by_v = w[2];
    for (std::size_t i = 0; i < kLatentHidden; ++i) {
      const double slope = w[3 + i] * (1.0 - a.hidden[i] * a.hidden[i]);
      value += w[3 + i] * a.hidden[i];
      by_u += slope * network[3 * i + 1];
      by_v += slope * network[3 * i + 2];
    }
    out.values[k] = value;
    out.by_volume[k] = by_u / kVolumeWidth;
    out.by_curve[k] = by_v / kCurveWidth;
  }
  return out;
}

LatentJacobian latent_jacobian(const LatentNetwork& network, double volume, double curve) {
  const Activations a = activate(network, volume, curve);
  LatentJacobian j = LatentJacobian::Zero();
  for (std::size_t k = 0; k < kIsotropicElastic; ++k) {
    const std::size_t at = output_at(k);
    const auto row = static_cast<Eigen::Index>(k);
    const auto put = [&](std::size_t column, double value) {
      j(row, static_cast<Eigen::Index>(column)) = value;
    };
    put(at, 1.0);
    put(at + 1, a.u);
    put(at + 2, a.v);
    for (std::size_t i = 0; i < kLatentHidden; ++i) {
      put(at + 3 + i, a.hidden[i]);
      const double slope = network[at + 3 + i] * (1.0 - a.hidden[i] * a.hidden[i]);
      put(3 * i, slope);
      put(3 * i + 1, slope * a.u);
      put(3 * i + 2, slope * a.v);
    }
  }
  return j;
}

}  // namespace matterfit::material
