// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>

#include "material/neural/latent.hpp"

namespace matterfit::material {

/// Weights of the energy for μ = 1 (the first is added to ln μ), and their slopes by the inputs.
struct LatentOutput {
  std::array<double, kIsotropicElastic> values;
  std::array<double, kIsotropicElastic> by_volume;
  std::array<double, kIsotropicElastic> by_curve;
};

[[nodiscard]] LatentOutput latent_output(const LatentNetwork& network, double volume, double curve);

/// Of the energy's weights by those of the network, for its training.
using LatentJacobian = Eigen::Matrix<double, static_cast<int>(kIsotropicElastic),
                                     static_cast<int>(kLatentWeights), Eigen::RowMajor>;
[[nodiscard]] LatentJacobian latent_jacobian(const LatentNetwork& network, double volume,
                                             double curve);

}  // namespace matterfit::material
