// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/parallel.hpp"
#include "material/neural/published_weights.hpp"
#include "material/neural/start_laws.hpp"

namespace matterfit::material {

/// Regression of the published law's two nets to a classical law, without a simulator: with F = R S
/// rotation drops out, so that the elastic net learns X(S) = S⁻¹τ and the plastic one X(S) =
/// (S_kept − S)/α over a substep of kPublishedSubstep, at principal strains turned at random.
struct PublishedPretraining {
  std::uint64_t seed = 1;
  int steps = 8000;          ///< of Adam, of each net
  std::size_t batch = 1024;  ///< samples of a step
};

/// The same weights for a seed and a SIMD target, whatever the number of threads.
[[nodiscard]] PublishedWeights pretrain_published(const Material& material,
                                                  const PublishedPretraining& options,
                                                  Arena& arena);

/// A pre-trained law against its classical one, at strains turned at random, for the nets are not
/// isotropic.
struct PublishedAccuracy {
  /// Uniaxial stress at these stretches, the other axes fixed: the mean relative error over
  /// directions, and the largest.
  static constexpr std::array<double, 5> kStretches{1.01, 0.99, 1.10, 0.90, 0.70};
  std::array<double, 5> uniaxial{};
  std::array<double, 5> uniaxial_worst{};
  /// Root mean square over sampled states of |τ − τ*| / (|τ*| + 1 % of the stress at a strain of
  /// 1).
  double stress = 0.0;
  /// Root mean square over trial states of the error in S after the flow, of the step that the flow
  /// takes, and of what flows in a substep where the classical law keeps the strain.
  double flow = 0.0;
  double flow_step = 0.0;
  double creep = 0.0;
};

[[nodiscard]] PublishedAccuracy published_accuracy(const PublishedWeights& weights,
                                                   const Material& material, std::uint64_t seed,
                                                   Arena& arena);

}  // namespace matterfit::material
