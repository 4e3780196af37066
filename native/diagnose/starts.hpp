// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <vector>

#include "diagnose/refit.hpp"
#include "diagnose/scores.hpp"
#include "diagnose/study.hpp"

namespace matterfit::diagnose {

/// [a | b], of as many rows.
[[nodiscard]] Eigen::MatrixXd beside(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

/// Whether what a cause needs beside it (Effect::beside) is among `causes`.
[[nodiscard]] bool stands(const Model& model, const Candidate& cause,
                          const std::vector<Candidate>& causes);

/// The effect's shape with the best score, for each effect; best first, observable ones.
[[nodiscard]] std::vector<std::size_t> best_shapes(const std::vector<Score>& scores);

/// The best few of those of which none imitates nine tenths of what a better one does; where
/// `of_use` is given, of those alone for which it holds.
[[nodiscard]] std::vector<std::size_t> unlike_shapes(
    const ScoreTest& test, const std::vector<Score>& scores, std::size_t most,
    const std::function<bool(const Score&)>& of_use = nullptr);

/// A refit's prediction and derivatives at its end, without candidates.
[[nodiscard]] Linearised linearised_at(const Refit& refit);

/// The candidate's derivatives, stacked; it must be among `slopes`.
[[nodiscard]] const Eigen::MatrixXd& columns_of(const Linearised& slopes,
                                                const Candidate& candidate);

/// A state with one more cause, by a share of its first estimate (in scales).
[[nodiscard]] State extended(const Model& model, const State& state, const Candidate& candidate,
                             const Eigen::VectorXd& estimate, double share);

}  // namespace matterfit::diagnose
