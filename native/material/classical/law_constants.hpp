// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>

#include "material/material.hpp"
#include "material/neural/isotropic_weights.hpp"

namespace matterfit::material {

template <class S>
struct MaxwellConstants {
  S modulus{};  ///< [Pa]
  S time{};     ///< [s]
};

/// What the kernels of laws-inl.hpp read: a Material reduced to the constants of its formulas, in
/// the scalar type of the kernel.
template <class S>
struct LawConstants {
  Law law = Law::kFixedCorotated;
  S lambda{};          ///< [Pa]
  S mu{};              ///< [Pa]
  S kappa{};           ///< λ + ⅔μ, or K for a fluid [Pa]
  bool split = false;  ///< neo-Hookean in the split of shape and volume
  S yield{};           ///< √(2/3) τ_Y: bound of |s| [Pa]
  S hardening{};       ///< [Pa]
  S eta{};             ///< 2 η_d for Herschel–Bulkley, η_d for a fluid [Pa s]
  S exponent{};
  S alpha{};          ///< Drucker–Prager √(2/3)·2 sin φ/(3 − sin φ)
  S tip{};            ///< Drucker–Prager: Hencky strain of the cone's tip, each axis
  S alpha_tip{};      ///< α·tip, finite for φ → 0
  S damping_shear{};  ///< [Pa s]
  S damping_bulk{};   ///< [Pa s]
  std::array<MaxwellConstants<S>, kMostMaxwellBranches> maxwell{};
  std::size_t maxwell_count = 0;
  bool damped = false;
  bool plastic = false;            ///< return mapping changes the elastic deformation gradient
  bool fluid = false;              ///< `eta` acts on the whole velocity gradient
  bool own_volume = false;         ///< no mean dilatation: the return mapping changes the trace
  IsotropicConstants<S> neural{};  ///< of the isotropic neural law
};

template <class S>
[[nodiscard]] LawConstants<S> law_constants(const Material& material);

/// Poisson's ratio from which the neo-Hookean law is split into shape and volume. Below, the
/// papers' form τ = μ(FFᵀ − I) + λ ln J I is kept; both agree to first order in the strain.
inline constexpr double kSplitPoissonRatio = 0.45;

}  // namespace matterfit::material
