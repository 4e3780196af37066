// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>

#include "diagnose/study.hpp"

namespace matterfit::diagnose {

/// Prior precision of θ per scale², and the mean in scales of natural coordinates.
struct ThetaPrior {
  Eigen::VectorXd precision;
  Eigen::VectorXd mean;  ///< natural
};
/// `corrections`: Noise::corrections.
[[nodiscard]] ThetaPrior theta_prior(const Model& model, double corrections = 1.0);

/// The same of the numbers of a state's causes, one after another, about their neutral values.
struct CausePriors {
  Eigen::VectorXd precision;  ///< per scale²; 0: none
  Eigen::VectorXd beyond;     ///< what the numbers are beyond neutral, in scales
};
[[nodiscard]] CausePriors cause_priors(const Model& model, const State& state);
/// Precision of a number's prior per scale²; 0: none.
[[nodiscard]] double precision_of(const Number& number);

}  // namespace matterfit::diagnose
