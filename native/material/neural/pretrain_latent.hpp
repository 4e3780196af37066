// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "base/parallel.hpp"
#include "base/random.hpp"
#include "material/neural/latent.hpp"
#include "material/neural/pretrain.hpp"

/// The latent law's decoder and encoder by regression to all classical laws over the ranges of
/// their numbers, without a simulator.
namespace matterfit::material {

struct LatentPretraining {
  std::uint64_t seed = 1;
  std::size_t materials = 1800;  ///< drawn once, as many of each law
  std::size_t steps = 24000;     ///< of Adam, on kLatentBatch materials each
};
inline constexpr std::size_t kLatentBatch = 48;

/// A classical material of a class (an entry of kLatentClasses), with a shear modulus at rest of 1
/// Pa: elastic: fixed corotated, neo-Hookean or Hencky, ν 0 to .49; plastic: von Mises, |dev ε| at
/// yield 1.5e-3 to .3, hardening for half of them; paste: Herschel–Bulkley, a rate of 1 to 1e6/s,
/// an exponent below 1 for half; granular: Drucker–Prager, friction angle 10° to 50°, cohesion for
/// half; liquid: a viscosity of 1e-8 to 2e-4 s times the bulk modulus.
[[nodiscard]] Material classical_of_class(std::size_t flow_class, Random& random);

/// Minimises, over encoder and decoder by Adam (Kingma & Ba 2015), the relative error of the
/// principal stress over sampled strains, and of the flow's logarithms (yield strain over sampled
/// changes of volume and plastic strains, tear strain, rate over sampled excess) where they can be
/// felt. The space is then turned and scaled so that the codes of the materials have mean 0 and
/// covariance 1. Deterministic in the seed, for any number of threads. Throws Error(kCompute) where
/// it does not improve on its start.
[[nodiscard]] std::shared_ptr<const LatentDecoder> pretrain_latent(const LatentPretraining& options,
                                                                   Arena& arena);

/// The isotropic law's weights that a material of the latent law has.
[[nodiscard]] IsotropicWeights isotropic_weights_of(const Material& latent);

/// A decoder against classical materials of a class, drawn with `seed`, at the codes that its
/// encoder gives them.
struct LatentAccuracy {
  std::string_view name;
  double stress = 0.0;        ///< median of LawAccuracy::stress
  double stress_worst = 0.0;  ///< of nineteen of twenty
  /// Medians of the root mean square of the natural logarithm of the ratio of both laws' yield
  /// strains (and a ten thousandth), over the states of the regression, and of their rates below
  /// 3e6/s; 0: it never flows.
  double yield = 0.0;
  double yield_worst = 0.0;
  double rate = 0.0;
  double of_class = 0.0;  ///< share of the materials that are of their class
};
[[nodiscard]] std::vector<LatentAccuracy> latent_accuracy(
    const std::shared_ptr<const LatentDecoder>& decoder, std::size_t materials, std::uint64_t seed,
    Arena& arena);

}  // namespace matterfit::material
