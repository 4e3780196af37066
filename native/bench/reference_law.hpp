// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/vec.hpp"

namespace matterfit::bench {

/// The five materials of the set, in the units of a job document, and a rubber that no law of the
/// solver describes.
enum class ReferenceLaw {
  kNeoHookean,
  kNewtonian,
  kHerschelBulkley,
  kVonMises,
  kDruckerPrager,
  kMullins
};

struct ReferenceMaterial {
  ReferenceLaw law = ReferenceLaw::kNeoHookean;
  double youngs_modulus = 1e5;  ///< [Pa], of all but the fluid
  double poisson_ratio = 0.3;
  double bulk_modulus = 0.0;    ///< of the fluid, the tangent at J = 1 [Pa]
  double viscosity = 0.0;       ///< dynamic [Pa s], of the fluid and of Herschel–Bulkley
  double yield_stress = 0.0;    ///< uniaxial [Pa]
  double friction_angle = 0.0;  ///< [degrees]
  double stiffening = 0.0;      ///< of the rubber: growth of its shear modulus per |dev ε|
  double softening = 0.0;       ///< of the rubber: share of the stress lost at no strain, below 1

  [[nodiscard]] double mu() const;
  [[nodiscard]] double lambda() const;
  /// √((λ + 2μ)/ρ), of the fluid √(K/ρ), of the rubber with the tangent μ at |dev ε| = 1/2 [m/s].
  [[nodiscard]] double wave_speed(double density) const;
};

/// What a particle remembers. The laws are isotropic, so the left Cauchy–Green tensor of the
/// elastic part is enough and no rotation is ever needed: b ← (I + dt ∇v) b (I + dt ∇v)ᵀ.
struct ReferenceState {
  Mat3d b = Mat3d::Identity();
  double J = 1.0;        ///< the fluid's only memory
  double largest = 0.0;  ///< |dev ε| of the rubber so far
};

/// Advances `state` by `dt` [s] with the velocity gradient `L` [1/s], return mapping included, and
/// gives the Kirchhoff stress τ [Pa].
///
/// neo-Hookean: τ = μ b + (λ ln J − μ) I. Newtonian, weakly compressible: τ = (K/7)(J − J⁻⁶) I +
/// η J (L + Lᵀ). The others are Hencky solids, τ = U (2με + λ tr ε) Uᵀ, ε = ½ ln of b's
/// eigenvalues, with the return along the deviator: von Mises |s| ≤ √(2/3) τ_Y; Herschel–Bulkley of
/// exponent 1, |s| = |s_tr| − (|s_tr| − √(2/3) τ_Y) / (1 + η/(μ̂ dt)), μ̂ = μ tr b/3 (Yue et al.
/// 2015); Drucker–Prager (Klár et al. 2016) without cohesion. The rubber is a Hencky solid whose
/// shear modulus grows and which softens on unloading (Mullins 1969; the pseudo-elastic form of
/// Ogden and Roxburgh 1999 made linear): τ = 2 μ (1 + a s) (1 − m (1 − s/s_max)) dev ε + K tr ε I,
/// s = |dev ε|, s_max its largest so far, a `stiffening`, m `softening`. Throws Error(kCompute)
/// where b has lost its positive eigenvalues.
[[nodiscard]] Mat3d advance(const ReferenceMaterial& material, const Mat3d& L, double dt,
                            ReferenceState& state);

}  // namespace matterfit::bench
