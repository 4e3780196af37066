// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.hpp"
#include "material/neural/published_weights.hpp"

namespace matterfit::material {

/// What one net of the published law is to give: features [n, 13] and the symmetric X [n, 6] (xx,
/// yy, zz, yz, xz, xy) of them; `weight` [n] of each squared error.
struct NetSamples {
  std::vector<float> features;
  std::vector<float> targets;
  std::vector<float> weight;
  [[nodiscard]] std::size_t size() const { return weight.size(); }
};

struct NetTraining {
  std::size_t passes = 16;  ///< through all samples
  std::size_t batch = 1024;
  double rate = 3e-3;  ///< of Adam (Kingma & Ba 2015), to 0 on a cosine
  std::uint64_t seed = 1;
};

/// Trains a net from random weights with the polynomial activation. The same bits for any number of
/// threads. Throws Error(kInput) if the samples do not agree, Error(kCompute) if it diverges.
[[nodiscard]] std::vector<float> train_net(const NetSamples& samples, const NetTraining& options,
                                           Arena& arena);

/// Random start weights, scaled so that signals keep their size through the layers.
[[nodiscard]] std::vector<float> random_net(std::uint64_t seed);

}  // namespace matterfit::material
