// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <string>

#include "base/tensors.hpp"
#include "material/classical/law_gradient.hpp"
#include "material/material.hpp"
#include "material/neural/isotropic_weights.hpp"

/// The isotropic neural law as a material: a few numbers that mean something in place of weights.
///
/// E and ν say the moduli at rest exactly, whatever the form; the flow's numbers are those of
/// IsotropicConstants. The form is what is left of the energy: that of a start law, moved along
/// four directions of its weights.
namespace matterfit::material {

/// Below this yield strain, and as little internal friction, nothing holds a body together.
inline constexpr double kLiquidStrain = 1e-3;

inline constexpr std::size_t kForms = 4;

/// A law to start from, and the directions in the logarithms of its gains that change the stress
/// most while the moduli at rest stay: right singular vectors of the derivatives of τ/|τ| over
/// sampled strains, each scaled so that a unit along it changes the stress by its own size on the
/// root mean square, to first order, or no gain by more than e³.
struct IsotropicStart {
  std::string name;  ///< as documents have it
  IsotropicWeights weights{};
  std::array<IsotropicWeights, kForms> directions{};  ///< entry 0 and those of the flow are 0
};

/// Finds the directions, on samples drawn with `seed`. Deterministic.
[[nodiscard]] std::shared_ptr<const IsotropicStart> with_directions(std::string name,
                                                                    const IsotropicWeights& weights,
                                                                    std::uint64_t seed);

/// A material that is the start law itself.
[[nodiscard]] Material isotropic_material(std::shared_ptr<const IsotropicStart> start);

/// What the kernels take. Where ν is so low that the form alone is stiffer against a change of
/// volume, κ keeps a thousandth of the shear modulus and the bulk modulus is the form's.
[[nodiscard]] IsotropicConstants<double> isotropic_constants(const Material& material);

/// The chain rule through isotropic_constants(): adds the derivatives by form and flow to
/// `gradient`, and gives those by the moduli at rest.
struct ModuliGradient {
  double shear = 0.0;
  double bulk = 0.0;
};
[[nodiscard]] ModuliGradient add_isotropic_gradient(const Material& material,
                                                    const IsotropicConstants<double>& constants_bar,
                                                    MaterialGradient& gradient);

/// Elastic where neither limit is ever met; granular with a tear strain; liquid where it yields at
/// a thousandth of strain without friction.
[[nodiscard]] FlowClass flow_class(const Material& material);

/// The material's start law with its weight_moves in the weights, which are then none: the same
/// law as long as the form stays on top of it.
[[nodiscard]] std::shared_ptr<const IsotropicStart> moved_start(const Material& material,
                                                                std::string name);

/// A weights file: tensors "isotropic" [36] and "directions" [4, 36]. The second throws
/// Error(kInput) that names what is missing, of another size, or no number.
[[nodiscard]] Tensors start_tensors(const IsotropicStart& start);
[[nodiscard]] std::shared_ptr<const IsotropicStart> isotropic_start(const Tensors& tensors,
                                                                    const std::string& name);

}  // namespace matterfit::material
