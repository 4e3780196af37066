// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <span>

#include "base/parallel.hpp"
#include "material/neural/isotropic_weights.hpp"

namespace matterfit::material {

/// Our neural law on many points at once, outside the solver. F is 3×3 row-major, shape [points,
/// 9], det F > 0; `strain` [points] is the equivalent plastic strain before the step; `dt` [s] the
/// step.
template <class S>
struct IsotropicPoints {
  std::span<const S> trial;
  std::span<const S> strain;
};

/// F after the flow, the plastic strain after it, and the Kirchhoff stress [Pa] as xx, yy, zz, yz,
/// xz, xy, shape [points, 6].
template <class S>
struct IsotropicResults {
  std::span<S> elastic;
  std::span<S> strain;
  std::span<S> tau;
};

/// S is float (the fastest SIMD target of the machine) or double (plain scalars, for proofs). The
/// same bits for any number of threads. Throws Error(kInput) if the spans do not agree.
template <class S>
void isotropic_forward(const IsotropicWeights& weights, double dt, const IsotropicPoints<S>& points,
                       const IsotropicResults<S>& results, Arena& arena);

/// Cotangents of what isotropic_forward gives; of a symmetric tensor the symmetric X with
/// dL = X : dτ, all nine entries counted.
template <class S>
struct IsotropicResultsBar {
  std::span<const S> elastic;
  std::span<const S> strain;
  std::span<const S> tau;
};

/// Cotangents of the trial F and strain, and of the weights (overwritten), which are summed in a
/// fixed number of partitions.
template <class S>
void isotropic_backward(const IsotropicWeights& weights, double dt,
                        const IsotropicPoints<S>& points, const IsotropicResultsBar<S>& bars,
                        std::span<S> trial_bar, std::span<S> strain_bar,
                        std::span<double, kIsotropicWeights> weights_bar, Arena& arena);

}  // namespace matterfit::material
