// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/parallel.hpp"
#include "material/neural/isotropic_weights.hpp"
#include "material/neural/published_weights.hpp"
#include "material/neural/start_laws.hpp"

namespace matterfit::material {

/// Regression of neural laws to classical ones on sampled states, without a simulator
/// (the stress of an isotropic law turns with F, so states are a stretch and its axes alone).
/// Deterministic in the seed, the same bits for any number of threads.
struct Pretraining {
  std::uint64_t seed = 1;
  std::size_t samples = std::size_t{1} << 18U;  ///< of each net of the published form
  std::size_t passes = 16;
  std::size_t batch = 1024;
  std::size_t fit_samples = 1500;  ///< of our form
};

/// Both nets. The target of the elastic one is X = Rᵀ τ R S⁻¹ with F = R S, of the plastic one
/// (S_kept − S_trial)/α; errors are weighted by the target's size. A material without flow leaves
/// the plastic net's last layer at zero.
[[nodiscard]] PublishedWeights pretrain_published(const Material& material,
                                                  const Pretraining& options, Arena& arena);

/// The energy's weights by Levenberg–Marquardt on the principal stresses, relative to their size;
/// the flow's weights are the classical constants themselves, in units of strain.
/// Throws Error(kCompute) if no step improves the start.
[[nodiscard]] IsotropicWeights pretrain_isotropic(const Material& material,
                                                  const Pretraining& options);

/// Weights of the flow that a classical law has, of a law with shear modulus `shear` at rest [Pa];
/// those of the energy are left.
void set_classical_flow(const Material& material, double shear, IsotropicWeights& weights);

/// A pre-trained law against its classical one.
struct LawAccuracy {
  /// Uniaxial stress at these stretches, the other axes fixed: relative errors.
  static constexpr std::array<double, 4> kStretches{1.01, 0.99, 1.10, 0.70};
  std::array<double, 4> uniaxial{};
  /// Root mean square over sampled states of |τ − τ*| / (|τ*| + 1 % of the stress at a strain of
  /// 1).
  double stress = 0.0;
  /// Root mean square over flow samples of the kept strain's error, and of the step that it ends.
  double flow = 0.0;
  double flow_step = 0.0;
};

[[nodiscard]] LawAccuracy accuracy(const PublishedWeights& weights, const Material& material,
                                   std::uint64_t seed, Arena& arena);
[[nodiscard]] LawAccuracy accuracy(const IsotropicWeights& weights, const Material& material,
                                   std::uint64_t seed, Arena& arena);

}  // namespace matterfit::material
