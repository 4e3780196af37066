// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "material/neural/published_weights.hpp"

namespace matterfit::material {

/// The published neural law on many points at once, outside the solver: for pre-training, for
/// checks and for measurements. F and τ are 3×3 row-major, shape [points, 9]; F is clamped to
/// singular values ≥ 0.05 first. `elastic` is F after the flow, `tau` the Kirchhoff stress [Pa],
/// which need not be symmetric. S is float (the fastest SIMD target of the machine) or double
/// (plain scalars, for proofs). The same bits for any number of threads.
/// Throws Error(kInput) if the spans do not agree.
template <class S>
void published_forward(const PublishedWeights& weights, GeluMode mode, std::span<const S> trial,
                       std::span<S> elastic, std::span<S> tau, Arena& arena);

/// Cotangents of the trial F and of the weights from those of `elastic` and `tau`. Weights: first
/// the elastic net's, then the plastic one's, 2 · kNetWeights; overwritten. They are summed in a
/// fixed number of partitions, whatever the number of threads.
template <class S>
void published_backward(const PublishedWeights& weights, GeluMode mode, std::span<const S> trial,
                        std::span<const S> elastic_bar, std::span<const S> tau_bar,
                        std::span<S> trial_bar, std::span<double> weights_bar, Arena& arena);

/// One substep of `dt` [s] of one point as the solver's kernels take it, in double: the polynomial
/// activation, and a flow in proportion to `dt`. Returns the Kirchhoff stress [Pa]; `elastic`: F
/// after the flow.
[[nodiscard]] Mat3d published_point(const PublishedWeights& weights, double dt, const Mat3d& trial,
                                    Mat3d& elastic);

/// Both nets, one after the other, as the kernels read them. Throws Error(kInput) as
/// check_published_weights().
template <class S>
[[nodiscard]] std::vector<S> joined_weights(const PublishedWeights& weights);

}  // namespace matterfit::material
