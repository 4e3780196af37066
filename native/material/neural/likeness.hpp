// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "material/excitation.hpp"
#include "material/material.hpp"

/// «What is it like?»: the classical law nearest to a neural one.
namespace matterfit::material {

/// A classical law against the neural one.
struct Likeness {
  Material material;  ///< of the classical law; damping and relaxation are the neural one's
  /// Mean of |τ − τ*| / (|τ*| + a hundredth of its root mean square) over the ways below, τ* the
  /// neural law's Kirchhoff stress.
  double stress = 0.0;
  /// The same of the deviator where the neural law flows, against |dev τ*|; 0: it flows nowhere.
  double flow = 0.0;
  double flowing = 0.0;  ///< share of the states in which the neural law flows
};

/// All classical laws fitted to the neural one, the nearest by `stress` first; of those that are as
/// near to a hundredth of that, the one with fewer numbers. Both follow the same ways, by the laws
/// of the solver's kernels (material/classical/point_law.hpp): a change of volume, and then of
/// shape in random directions at rates within the excitation, and some way back. Parameters are
/// those of least mean difference, by Levenberg–Marquardt from the neural law's moduli and flow.
/// Deterministic in the seed. Throws Error(kInput) where the material is not of the neural law, or
/// the excitation is empty.
[[nodiscard]] std::vector<Likeness> likenesses(const Material& neural, const Excitation& over,
                                               std::uint64_t seed = 1);

/// "Neo-Hookean, τ = μ(FFᵀ − 1) + λ ln J 1 with E = 4.07e+04 Pa and ν = 0.42 (μ = …): within 1.2 %
/// of the stress up to strains of 0.3".
[[nodiscard]] std::string likeness_sentence(const Likeness& like, const Excitation& over);

}  // namespace matterfit::material
