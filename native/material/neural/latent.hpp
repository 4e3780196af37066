// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/tensors.hpp"
#include "material/material.hpp"
#include "material/neural/isotropic_weights.hpp"

namespace matterfit::material {

/// The latent law: one network for the family of all classical laws. Eight numbers choose a law;
/// the network turns them into the weights of the isotropic law (isotropic_weights.hpp), once a
/// material and not once a particle. So every latent is an objective, isotropic, dissipating law
/// with a convex energy, and costs what the isotropic law costs.
///
/// The numbers are coordinates with a meaning, so that each shows in the motion on its own: the
/// scale of stresses stands apart, and the network is dimensionless.
inline constexpr std::size_t kLatentNumbers = 8;
using Latent = std::array<double, kLatentNumbers>;

inline constexpr std::size_t kLatentModulus = 0;  ///< ln μ [Pa], at rest
inline constexpr std::size_t kLatentVolume = 1;   ///< ln(κ/μ), at rest
inline constexpr std::size_t kLatentCurve = 2;    ///< curvature of stress by stretch: Hencky's 0,
                                                ///< neo-Hookean 1, fixed corotated 1.5, fluids −2.5
inline constexpr std::size_t kLatentYield = 3;      ///< ln of the yield strain
inline constexpr std::size_t kLatentFriction = 4;   ///< ln of yield strain per compression
inline constexpr std::size_t kLatentRate = 5;       ///< ln of the rate of relaxation [1/s]
inline constexpr std::size_t kLatentTension = 6;    ///< ln of the dilatation where it tears
inline constexpr std::size_t kLatentHardening = 7;  ///< ln of yield strain per plastic strain

/// Bounds of a fit, and of what the network was trained on.
struct LatentRange {
  std::string_view name;
  double low;
  double high;
};
[[nodiscard]] const std::array<LatentRange, kLatentNumbers>& latent_ranges();

/// Latents of a classical law. Maxwell branches, damping and exponents other than 1 are left out.
[[nodiscard]] Latent latent_of(const Material& material);

/// Two inputs (volume, curve), kLatentHidden tanh units, the weights of the energy for μ = 1 Pa.
inline constexpr std::size_t kLatentHidden = 12;
inline constexpr std::size_t kLatentOutputs = kIsotropicElastic;
inline constexpr std::size_t kLatentWeights =
    3 * kLatentHidden + kLatentOutputs * (kLatentHidden + 3);

/// The network's weights: of each hidden unit its bias and two inputs', then of each output its
/// bias, the two inputs' directly, and the hidden units'.
using LatentNetwork = std::vector<double>;

/// Throws Error(kInput) unless the network has kLatentWeights finite numbers.
void check_latent_network(const LatentNetwork& network, const std::string& name);

[[nodiscard]] IsotropicWeights latent_weights(const LatentNetwork& network, const Latent& latent);

/// Adds to `latent_bar` the cotangent of the latents from that of the isotropic law's weights.
void add_latent_adjoint(const LatentNetwork& network, const Latent& latent,
                        const IsotropicWeights& weights_bar, Latent& latent_bar);

struct LatentPretraining {
  std::uint64_t seed = 1;
  std::size_t materials = 240;
  std::size_t states = 64;  ///< of each material
  int most_steps = 120;
};

/// Trains the network on classical laws whose Poisson's ratio and kind are sampled over the ranges
/// (fixed corotated, neo-Hookean, Hencky; fluids by their pressure), by Levenberg–Marquardt on
/// principal stresses relative to their size. Deterministic in the seed.
[[nodiscard]] LatentNetwork pretrain_latent(const LatentPretraining& options);

/// As a material file holds it: tensor "latent_network". Throws Error(kInput) on reading.
[[nodiscard]] Tensors latent_tensors(const LatentNetwork& network);
[[nodiscard]] LatentNetwork latent_network(const Tensors& tensors, const std::string& name);

}  // namespace matterfit::material
