// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>

#include "base/tensors.hpp"

namespace matterfit::material {

inline constexpr std::size_t kShapeUnits = 4;
inline constexpr std::size_t kVolumeUnits = 4;

/// Our neural law: an input-convex network of principal Hencky strains εᵢ = ln σᵢ, shared by the
/// three, and of θ = ln J; and a flow that returns along the deviatoric strain.
///
/// Energy (per rest volume) ψ = μ |dev ε|² + ½ κ θ² + Σₖ aₖ Σᵢ L(bₖ εᵢ + dₖ θ; cₖ)
///                              + Σₘ Aₘ L(Dₘ θ; Cₘ),
/// L(z; c) = ln cosh(z + c) − ln cosh c − z tanh c: convex, zero with its slope at z = 0. With
/// μ, κ, a, A ≥ 0 ψ is convex in ε, which is Hill's condition (the true stress grows with the
/// logarithmic strain; Hill 1970); it is symmetric in the stretches, so τ = Σ ∂ψ/∂εᵢ nᵢ⊗nᵢ is
/// objective, isotropic, symmetric, and zero at rest for any weights. Its stiffness is bounded:
/// L″ ≤ 1, so the largest wave speed is known before a run. Not covered: energies that are not
/// convex in ε (fixed corotated below a stretch of one half).
///
/// Flow: with q = |dev ε| of the trial state and an equivalent plastic strain p,
///   Y = s(yield + hardening · p − friction · θ), s(x) = ½ (x + √(x² + w²)), w = kYieldWidth,
///   q > Y: dev ε ← dev ε (Y + (q − Y)/(1 + ρ dt))/q, ρ = rate + thinning · (q − Y) ≥ 0,
///   θ > tension: the whole strain is scaled back so that θ = tension.
/// Both scale strains towards a minimum of ψ on a ray along which it is convex, so each step frees
/// energy: the flow dissipates for any weights. Rate → ∞ is a plastic solid (friction: granular),
/// yield → 0 a Maxwell fluid of viscosity μ/ρ.
///
/// The members are V: a scalar, or registers of lanes for cotangents.
template <class V>
struct IsotropicConstants {
  V mu;                           ///< [Pa]
  V kappa;                        ///< [Pa]
  V shape_gain[kShapeUnits];      ///< a [Pa]
  V shape_own[kShapeUnits];       ///< b
  V shape_trace[kShapeUnits];     ///< d
  V shape_offset[kShapeUnits];    ///< tanh c
  V volume_gain[kVolumeUnits];    ///< A [Pa]
  V volume_trace[kVolumeUnits];   ///< D
  V volume_offset[kVolumeUnits];  ///< tanh C
  V yield;                        ///< a strain
  V friction;                     ///< ≥ 0
  V hardening;                    ///< strain of yield per plastic strain
  V tension;                      ///< a strain
  V rate;                         ///< [1/s]
  V thinning;                     ///< [1/s] per strain

  /// In the order of the weights.
  template <class Visit>
  void for_each(const Visit& visit) {
    visit(mu);
    visit(kappa);
    for (V* units : {shape_gain, shape_own, shape_trace, shape_offset})
      for (std::size_t k = 0; k < kShapeUnits; ++k) visit(units[k]);
    for (V* units : {volume_gain, volume_trace, volume_offset})
      for (std::size_t k = 0; k < kVolumeUnits; ++k) visit(units[k]);
    for (V* entry : {&yield, &friction, &hardening, &tension, &rate, &thinning}) visit(*entry);
  }
};

/// Strain over which the yield strain is rounded off where it would become negative.
inline constexpr double kYieldWidth = 1e-4;

/// Weights are unconstrained numbers, which a fit moves; each gives one constant:
/// mu = exp(w₀); kappa and the gains are mu · exp(w); own and trace the weight itself; offsets
/// tanh(w); the flow's six exp(w). So w₀ alone is the scale of all stresses.
inline constexpr std::size_t kIsotropicElastic = 2 + 4 * kShapeUnits + 3 * kVolumeUnits;
inline constexpr std::size_t kIsotropicFlow = 6;
inline constexpr std::size_t kIsotropicWeights = kIsotropicElastic + kIsotropicFlow;
using IsotropicWeights = std::array<double, kIsotropicWeights>;

/// The first weight of each unit's entry, one a unit.
inline constexpr std::size_t kShapeGainWeight = 2;
inline constexpr std::size_t kShapeOwnWeight = kShapeGainWeight + kShapeUnits;
inline constexpr std::size_t kShapeTraceWeight = kShapeOwnWeight + kShapeUnits;
inline constexpr std::size_t kShapeOffsetWeight = kShapeTraceWeight + kShapeUnits;
inline constexpr std::size_t kVolumeGainWeight = kShapeOffsetWeight + kShapeUnits;
inline constexpr std::size_t kVolumeTraceWeight = kVolumeGainWeight + kVolumeUnits;
inline constexpr std::size_t kVolumeOffsetWeight = kVolumeTraceWeight + kVolumeUnits;
static_assert(kVolumeOffsetWeight + kVolumeUnits == kIsotropicElastic);

/// Whether a weight is the logarithm of a unit's gain.
[[nodiscard]] constexpr bool is_gain_weight(std::size_t weight) {
  return (weight >= kShapeGainWeight && weight < kShapeOwnWeight) ||
         (weight >= kVolumeGainWeight && weight < kVolumeTraceWeight);
}

/// Indices of the flow's weights.
inline constexpr std::size_t kYieldWeight = kIsotropicElastic;
inline constexpr std::size_t kFrictionWeight = kIsotropicElastic + 1;
inline constexpr std::size_t kHardeningWeight = kIsotropicElastic + 2;
inline constexpr std::size_t kTensionWeight = kIsotropicElastic + 3;
inline constexpr std::size_t kRateWeight = kIsotropicElastic + 4;
inline constexpr std::size_t kThinningWeight = kIsotropicElastic + 5;

template <class S>
[[nodiscard]] IsotropicConstants<S> isotropic_constants(const IsotropicWeights& weights);

/// Adds to `weights_bar` the cotangents of the weights from those of the constants.
void add_isotropic_weights_adjoint(const IsotropicWeights& weights,
                                   IsotropicConstants<double> constants_bar,
                                   std::span<double, kIsotropicWeights> weights_bar);

/// Upper bound over all strains of ∂τ/∂ε along any one stretch [Pa]: what λ + 2μ is to a linear
/// law.
[[nodiscard]] double longest_wave_modulus(const IsotropicConstants<double>& c);
/// The largest over strains up to kWaveStrain along each axis, where units do not all peak at once;
/// for the step limit, which asks no more of a classical law.
[[nodiscard]] double usual_wave_modulus(const IsotropicConstants<double>& c);
inline constexpr double kWaveStrain = 0.1;

/// Moduli at rest [Pa]: G = `shear`, K = `bulk_by_shape` + `bulk_by_volume`, the second of κ and
/// the volume units, the first of the shape units.
struct RestStiffness {
  double shear = 0.0;
  double bulk_by_shape = 0.0;
  double bulk_by_volume = 0.0;
};
[[nodiscard]] RestStiffness rest_stiffness(const IsotropicConstants<double>& c);
/// Adds to `c_bar` from the cotangents of its entries.
void add_rest_stiffness_adjoint(const IsotropicConstants<double>& c, const RestStiffness& bar,
                                IsotropicConstants<double>& c_bar);
[[nodiscard]] double rest_shear_modulus(const IsotropicWeights& weights);

/// A law that is Hencky's with these moduli and never yields: units are silent but ready to learn.
[[nodiscard]] IsotropicWeights plain_isotropic(double shear_modulus, double bulk_modulus);

/// What a material file holds: one tensor "isotropic" of kIsotropicWeights numbers.
[[nodiscard]] Tensors isotropic_tensors(const IsotropicWeights& weights);
/// The opposite. Throws Error(kInput).
[[nodiscard]] IsotropicWeights isotropic_weights(const Tensors& tensors, const std::string& name);

}  // namespace matterfit::material
