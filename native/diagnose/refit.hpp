// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnose/noise.hpp"
#include "diagnose/study.hpp"
#include "diagnose/whitening.hpp"

namespace matterfit::diagnose {

/// A model that was fitted to the used rows.
struct Refit {
  State state;
  double bias = 0.0;           ///< amplitude of the grid's extrapolated error; 0: not at work
  double deviance = 0.0;       ///< χ² and priors; smaller is better
  double chi_square = 0.0;     ///< of the rows alone
  double freedom = 1.0;        ///< rows less numbers
  Eigen::VectorXd prediction;  ///< stacked, with the bias [m]
  Eigen::VectorXd error;       ///< of the active causes' numbers, physical, linearised
  bool at_bound = false;       ///< a number of a cause lies at its bound
  bool converged = false;
};

struct RefitOptions {
  int iterations = 15;      ///< accepted steps at most
  double tolerance = 0.02;  ///< decrease of χ² promised by the next step that ends a refit
  DifferenceOptions differences;
};

/// Refits everything, θ, α and the bias's amplitude, under one covariance.
class Refitter {
 public:
  /// `study` outlives it.
  Refitter(const Study& study, const Noise& noise, const Spread& spread, RefitOptions options);

  /// Levenberg–Marquardt within bounds from the best of `starts` (same causes in the same shapes).
  /// `slopes`: [θ | α] derivatives in scales, stacked, valid about there; empty: made. Slopes are
  /// brought up to date by Broyden's rule and made anew where steps no longer gain what they
  /// promise. Throws Error(kCompute) where no start can be simulated.
  [[nodiscard]] Refit fit(const std::vector<State>& starts, Eigen::MatrixXd slopes) const;

  [[nodiscard]] const Whitening& whitening() const { return whitening_; }
  /// Derivative of the prediction by the bias's amplitude, stacked; no rows where there is none.
  [[nodiscard]] const Eigen::VectorXd& bias() const { return bias_; }
  [[nodiscard]] const Study& study() const { return *study_; }

 private:
  struct Place;
  [[nodiscard]] Place place(const State& state, double bias, const Eigen::VectorXd& seen) const;
  [[nodiscard]] Eigen::MatrixXd slopes_at(const State& state) const;
  [[nodiscard]] Eigen::MatrixXd residual_slopes(const Eigen::MatrixXd& slopes) const;

  const Study* study_;
  RefitOptions options_;
  Whitening whitening_;
  Eigen::VectorXd bias_;
};

/// The bias is about what the extrapolation says, to a standard deviation of as much: orders of
/// convergence between ½ and 2 lie within.
inline constexpr double kBiasMean = 1.0;
inline constexpr double kBiasSigma = 1.0;

/// Prior precision of θ per scale², and the mean in scales of natural coordinates.
struct ThetaPrior {
  Eigen::VectorXd precision;
  Eigen::VectorXd mean;  ///< natural
};
[[nodiscard]] ThetaPrior theta_prior(const Model& model);

}  // namespace matterfit::diagnose
