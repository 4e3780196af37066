// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "diagnose/scores.hpp"

namespace matterfit::diagnose {

struct PlaceboOptions {
  int draws = 1000;       ///< of noise
  int member_draws = 20;  ///< of noise, for each member of the solver's ensemble left out
  double level = 0.05;    ///< of false alarms over all causes together
  std::uint64_t seed = 1;
};

/// The largest score over all causes, shapes and scopes where nothing is hidden.
struct Placebo {
  std::vector<double> noise;   ///< ascending
  std::vector<double> solver;  ///< ascending, ensemble members left out; may be empty
  double threshold = 0.0;      ///< T*: the stricter of both at the level
  /// Probability of a largest score like this one, the larger of both; never 0.
  [[nodiscard]] double p(double equivalent) const;
};

/// Draws of noise: the columns' products with it are normal with one of `covariances` (equally
/// probable correlations of the noise), times a factor for the standard deviation's own error, seen
/// in `freedom` degrees.
void draw_noise(const ScoreTest& test, const std::vector<Eigen::MatrixXd>& covariances,
                double freedom, const PlaceboOptions& options, Placebo& placebo);

/// Draws where the data come from a member of the solver's ensemble that the covariance does not
/// know, larger or smaller by what an ensemble may be off. `gram`: of [nuisances | candidates | U |
/// members] whitened by the measurement's noise alone, U Uᵀ the solver's covariance with the member
/// that each column was made of, members as deviations in full size. Columns of no member (−1) are
/// one standard deviation each of what every draw has by an amount of its own. Fewer than four
/// members say nothing.
void draw_members(const Eigen::MatrixXd& gram, const std::vector<int>& member,
                  const Eigen::VectorXd& precision, const std::vector<Tested>& tested,
                  const PlaceboOptions& options, Placebo& placebo);

/// The threshold at the level from both lists.
void set_threshold(const PlaceboOptions& options, Placebo& placebo);

}  // namespace matterfit::diagnose
