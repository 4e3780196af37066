// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "base/random.hpp"
#include "material/neural/published_weights.hpp"

namespace matterfit::material {

/// Weights whose nets are linear in the invariants, since gelu(x) − gelu(−x) = x with either
/// activation: X_elastic = μ (FᵀF − I) + ½ λ tr(FᵀF − I) I, of moduli at rest λ and μ, and
/// X_plastic = −`flow` dev(FᵀF − I).
inline PublishedWeights linear_published(double lambda, double mu, double flow) {
  constexpr std::size_t kSecond = kNetHidden * kNetFeatures;
  constexpr std::size_t kThird = kSecond + kNetHidden * kNetHidden;
  const auto net = [&](double along, double of_trace) {
    std::vector<float> w(kNetWeights, 0.0F);
    for (std::size_t i = 0; i < kNetFeatures; ++i) {
      for (std::size_t side = 0; side < 2; ++side) {
        const float sign = side == 0 ? 1.0F : -1.0F;
        w[(2 * i + side) * kNetFeatures + i] = sign;
        w[kSecond + (2 * i + side) * kNetHidden + 2 * i] = sign;
        w[kSecond + (2 * i + side) * kNetHidden + 2 * i + 1] = -sign;
      }
    }
    const auto add = [&](std::size_t row, std::size_t feature, double value) {
      float* at = &w[kThird + row * kNetHidden + 2 * feature];
      at[0] += static_cast<float>(value);
      at[1] -= static_cast<float>(value);
    };
    for (std::size_t k = 0; k < 9; ++k) add(k, 3 + k, along);
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) add(4 * i, 3 + 4 * j, of_trace);
    return w;
  };
  return {net(mu, 0.5 * lambda), net(-flow, flow / 3.0)};
}

/// Those with noise of `size` on all weights, so that neither stress nor flow is isotropic, nor
/// linear, and the stress not symmetric.
inline PublishedWeights noisy_published(double lambda, double mu, double flow, double size,
                                        std::uint64_t seed) {
  PublishedWeights weights = linear_published(lambda, mu, flow);
  Random random(seed);
  const auto stir = [&](std::vector<float>& net, double scale) {
    for (std::size_t i = 0; i < kNetWeights; ++i) {
      const bool first = i < kNetHidden * kNetFeatures;
      const bool last = i >= kNetHidden * (kNetFeatures + kNetHidden);
      const double by = size * (first ? 1.0 : last ? scale : 0.3);
      net[i] += static_cast<float>(random.between(-by, by));
    }
  };
  stir(weights.elastic, mu);
  stir(weights.plastic, flow);
  return weights;
}

}  // namespace matterfit::material
