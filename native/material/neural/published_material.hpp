// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "material/material.hpp"
#include "material/neural/published_weights.hpp"

/// The published law as a material: its weights, and the moduli that the solver's step, its contact
/// and what is reported of a body go by.
namespace matterfit::material {

struct PublishedLaw {
  std::string name;  ///< as documents have it
  PublishedWeights weights;
  /// Ways that a material's weight_moves go from these, each 2 · kNetWeights as joined_weights();
  /// empty: none.
  std::vector<std::vector<float>> directions;
  // The elastic net's at rest, which need not be isotropic: those of the isotropic material that is
  // nearest to it.
  double youngs_modulus = 0.0;  ///< [Pa]
  double poisson_ratio = 0.0;
  /// The steepest slope of the stress along a pull or push up to a fifth, over directions [Pa].
  double wave_modulus = 0.0;
};

/// Measures the moduli by differences of τ in double. Throws Error(kInput) that names `name` where
/// the weights are none, or hold nothing at rest against shear or against a change of volume.
[[nodiscard]] std::shared_ptr<const PublishedLaw> make_published_law(PublishedWeights weights,
                                                                     std::string name);

/// The weights of a material of this law: those of its law and, along the law's directions, its
/// weight_moves.
[[nodiscard]] PublishedWeights moved_published(const Material& material);
/// Takes the moves of a material of this law into weights of its own, with their moduli, and sets
/// them to 0; the directions stay. Throws Error(kInput) as make_published_law().
void settle_moves(Material& material);

/// A material of it, its E and ν the measured ones.
[[nodiscard]] Material published_material(std::shared_ptr<const PublishedLaw> law);

}  // namespace matterfit::material
