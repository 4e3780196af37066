// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "diagnose/noise.hpp"
#include "diagnose/study.hpp"

namespace matterfit::diagnose {

/// A cause of a class, and its first estimate in scales.
struct Rival {
  Candidate candidate;
  Eigen::VectorXd estimate;
};

/// Gram matrix of [θ | columns of the candidates] in an experiment that was not made, whitened by
/// noise like that of the first capture; empty where it could not be simulated. Parameters of one
/// capture stand for those of the new recording, whose samples know nothing of the old one's.
[[nodiscard]] Eigen::MatrixXd experiment_gram(const Study& study, int experiment,
                                              const std::vector<Candidate>& candidates,
                                              const Noise& noise);

/// Gram matrix of present samples and new ones together, [θ | θ of the new recording alone |
/// candidates]: parameters of one capture (`own` >= 0, of the p first columns) are others there.
[[nodiscard]] Eigen::MatrixXd join_recordings(const Eigen::MatrixXd& present,
                                              const Eigen::MatrixXd& fresh, Eigen::Index p,
                                              const std::vector<int>& own);

/// The sentence of the experiment that separates the rivals best: the largest smallest
/// λ (1 − C²) over their pairs, from present samples and new ones together. Pairs that none of the
/// experiments separates (less than 9.2) do not count, and are named after the sentence. Empty
/// where the model has no experiments, or none separates each of the pairs that any of them does.
[[nodiscard]] std::string separating_recording(const Study& study, const Linearised& slopes,
                                               const Noise& noise,
                                               const std::vector<Rival>& rivals);

}  // namespace matterfit::diagnose
