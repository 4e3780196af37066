// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <vector>

namespace matterfit::material {

/// The networks of the published law (Ma et al., ICML 2023, «invariant full»; also where MASIV
/// starts): 13 → 64 → 64 → 9 with GELU between, no biases.
inline constexpr std::size_t kNetFeatures = 13;
inline constexpr std::size_t kNetHidden = 64;
inline constexpr std::size_t kNetOutputs = 9;
inline constexpr std::size_t kNetWeights =
    kNetFeatures * kNetHidden + kNetHidden * kNetHidden + kNetHidden * kNetOutputs;

/// Scale of the plastic net's step: F = F_trial + α R X.
inline constexpr double kPublishedFlowScale = 1e-3;
/// The substep that it was trained with (Ma et al., ICML 2023) [s].
inline constexpr double kPublishedSubstep = 5e-4;

/// α of a substep of `dt` [s]: in proportion, so that what flows in a second is the weights' and
/// not the solver's; kPublishedFlowScale at kPublishedSubstep.
[[nodiscard]] constexpr double published_flow(double dt) {
  return kPublishedFlowScale * (dt / kPublishedSubstep);
}

/// Weights of both nets, each kNetWeights long: the three matrices one after another, (out × in)
/// row-major.
struct PublishedWeights {
  std::vector<float> elastic;
  std::vector<float> plastic;
};

/// Throws Error(kInput) unless both nets have their size and every weight is finite; `name` stands
/// in the message.
void check_published_weights(const PublishedWeights& weights, const char* name);

/// How the activation is evaluated: exactly, as the weights were trained elsewhere, or by a
/// polynomial three times as fast (gelu-inl.hpp), whose gradient is the polynomial's own.
enum class GeluMode { kExact, kPolynomial };

}  // namespace matterfit::material
