// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <vector>

#include "base/random.hpp"
#include "base/vec.hpp"
#include "material/material.hpp"

namespace matterfit::material {

/// Materials that neural laws are pre-trained on (Ma et al., ICML 2023): fixed corotated jelly E
/// 1e5, ν .2; plasticine E 3e5, ν .25, von Mises 5e3 in that code's convention; sand E 1e6, ν .2,
/// friction angle 25°; water of the bulk modulus of E 1e5, ν .3.
enum class StartLaw { kJelly, kPlasticine, kSand, kWater };
inline constexpr std::array kStartLaws{StartLaw::kJelly, StartLaw::kPlasticine, StartLaw::kSand,
                                       StartLaw::kWater};

[[nodiscard]] std::string_view start_law_name(StartLaw law);
/// Throws Error(kInput) that lists the names.
[[nodiscard]] StartLaw start_law_from_name(std::string_view name);
[[nodiscard]] Material start_material(StartLaw law);

/// Shear and bulk modulus [Pa] that our law has at rest for a classical one. A fluid is a Maxwell
/// fluid whose stress relaxes within a millisecond: its shear modulus is a thousand times its
/// viscosity per second, or a thousandth of its bulk modulus where that is more.
struct RestModuli {
  double shear;
  double bulk;
};
[[nodiscard]] RestModuli rest_moduli(const Material& material);

/// A classical law in principal axes: what a net is to learn from it.
struct PrincipalSample {
  Vec3d trial;  ///< principal Hencky strains before the flow
  Vec3d kept;   ///< after it
  /// Principal Kirchhoff stresses of `trial` by the elasticity alone [Pa]; a fluid's with the shear
  /// that relaxes.
  Vec3d tau;
};

/// Substep of flow samples [s]: nearly rate-independent laws do not feel it.
inline constexpr double kSampleStep = 1e-4;

[[nodiscard]] PrincipalSample principal_sample(const Material& material, const Vec3d& trial,
                                               double dt = kSampleStep);

/// Hencky strains of random direction and size 0.7 u^1.5, u uniform (physics of pre-training), with
/// J ≥ 0.55: below, the solver's safeguard takes over and a fixed corotated solid softens.
[[nodiscard]] std::vector<PrincipalSample> elastic_samples(const Material& material,
                                                           std::size_t count, Random& random);
/// Trial strains up to a substep's step beyond where the flow leaves a strain.
[[nodiscard]] std::vector<PrincipalSample> flow_samples(const Material& material, std::size_t count,
                                                        Random& random);

}  // namespace matterfit::material
