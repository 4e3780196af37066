// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>

#include "diagnose/model.hpp"

namespace matterfit::diagnose {

/// Prior precision of θ per scale², and the mean in scales of natural coordinates.
struct ThetaPrior {
  Eigen::VectorXd precision;
  Eigen::VectorXd mean;  ///< natural
};
/// `corrections`: Noise::corrections.
[[nodiscard]] ThetaPrior theta_prior(const Model& model, double corrections = 1.0);

}  // namespace matterfit::diagnose
