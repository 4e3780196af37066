// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "material/neural/published_weights.hpp"

namespace matterfit::material {

/// What one net of the published law is to give at symmetric stretches S = FᵀF^½, where no rotation
/// is left: X(S).
struct NetSamples {
  std::vector<float> features;  ///< [n][13]
  std::vector<float> targets;   ///< X by rows, [n][9]
  std::vector<float> weights;   ///< of the errors, [n]

  [[nodiscard]] std::size_t size() const { return weights.size(); }
  void clear();
  /// Adds the sample S = Q diag(e^strain) Qᵀ, X = Q diag(`x`) Qᵀ.
  void add(const Mat3d& q, const Vec3d& strain, const Vec3d& x, double weight);
};

/// Σ (weight |X − X*|)² of one net's kNetWeights, with the activation that the solver's kernels
/// take, and its derivatives by the weights (overwritten). The same bits for any number of threads.
[[nodiscard]] double net_loss(std::span<const float> net, const NetSamples& samples,
                              std::span<double> gradient, Arena& arena);

}  // namespace matterfit::material
