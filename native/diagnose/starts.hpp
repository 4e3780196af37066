// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "diagnose/scores.hpp"
#include "diagnose/study.hpp"

namespace matterfit::diagnose {

/// [a | b], of as many rows.
[[nodiscard]] Eigen::MatrixXd beside(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

/// The effect's shape with the best score, for each effect; best first, observable ones.
[[nodiscard]] std::vector<std::size_t> best_shapes(const std::vector<Score>& scores);

/// The candidate's derivatives, stacked; it must be among `slopes`.
[[nodiscard]] const Eigen::MatrixXd& columns_of(const Linearised& slopes,
                                                const Candidate& candidate);

/// A state with one more cause, by a share of its first estimate (in scales).
[[nodiscard]] State extended(const Model& model, const State& state, const Candidate& candidate,
                             const Eigen::VectorXd& estimate, double share);

}  // namespace matterfit::diagnose
