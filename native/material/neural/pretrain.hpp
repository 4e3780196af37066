// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/parallel.hpp"
#include "material/neural/isotropic_weights.hpp"
#include "material/neural/start_laws.hpp"

namespace matterfit::material {

/// Regression of the isotropic neural law to classical ones on sampled principal strains, without
/// a simulator. Deterministic in the seed.
struct Pretraining {
  std::uint64_t seed = 1;
  std::size_t fit_samples = 1500;
};

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

[[nodiscard]] LawAccuracy accuracy(const IsotropicWeights& weights, const Material& material,
                                   std::uint64_t seed, Arena& arena);

}  // namespace matterfit::material
