// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "diagnose/noise.hpp"
#include "diagnose/priors.hpp"
#include "diagnose/spread.hpp"
#include "diagnose/study.hpp"
#include "diagnose/whitening.hpp"

namespace matterfit::diagnose {

/// A model that was fitted to the used rows.
struct Refit {
  State state;
  std::size_t began = 0;       ///< in RefitStart::states
  double bias = 0.0;           ///< amplitude of the grid's extrapolated error; 0: not at work
  double deviance = 0.0;       ///< χ² and priors; smaller is better
  double chi_square = 0.0;     ///< of the rows alone
  double freedom = 1.0;        ///< rows less numbers
  Eigen::VectorXd prediction;  ///< stacked, with the bias [m]
  Eigen::VectorXd error;       ///< of the active causes' numbers, physical, linearised
  Eigen::MatrixXd slopes;      ///< [θ | α] derivatives about there, in scales, of the used rows
  /// The factor on the stated deviations of Model::corrections() in this search.
  double corrections = 1.0;
  bool at_bound = false;  ///< a number of a cause lies at its bound
  bool converged = false;
};

struct RefitOptions {
  int iterations = 30;  ///< accepted steps at most
  /// A search makes its slopes anew by differences as long as that pays, and so often at most where
  /// it does not: a renewal pays where the deviance has fallen by `worth` of itself since the one
  /// before.
  int renewals = 1;
  double worth = 0.05;
  /// Decrease of χ² promised by the next step that ends a refit, and the same as a share of χ²:
  /// far below what excludes a rival.
  double tolerance = 0.1;
  double share = 1e-4;
  /// Study::search_work() after which searches end where they are.
  int most_runs = std::numeric_limits<int>::max();
  DifferenceOptions differences;
};

/// Where a refit may begin: states with the same causes in the same shapes, and [θ | α] derivatives
/// in scales, stacked, that hold about there; without columns they are made.
struct RefitStart {
  std::vector<State> states;
  Eigen::MatrixXd slopes;
  int renewals = 0;    ///< beyond RefitOptions::renewals
  bool renew = false;  ///< `slopes` are of another place: all but the kept ones are made first
  /// `slopes` were made by differences at the first state. From another one they are made anew,
  /// those of nuisances of known times are kept.
  bool made_there = false;
  /// Slopes of nuisances of known times are made anew as the others are: for a search from far off.
  bool whole = false;
  bool rough = false;        ///< only on the way: ends where a step promises less than a hundredth
  double corrections = 0.0;  ///< Refit::corrections; 0: Noise::corrections
};

/// An information matrix that can be inverted although a number is not identifiable.
[[nodiscard]] Eigen::MatrixXd regularised(Eigen::MatrixXd information);

/// Diagonal of the inverse of an information matrix; large for numbers that are not identifiable.
[[nodiscard]] Eigen::VectorXd variances_of(Eigen::MatrixXd information);

/// Refits everything, θ, α and the bias's amplitude, under one covariance.
class Refitter {
 public:
  /// `study` outlives it.
  Refitter(const Study& study, const Noise& noise, const Spread& spread, RefitOptions options);

  /// Levenberg–Marquardt within bounds from the best state of each start, all of them in step, so
  /// that their simulations run side by side. Slopes are brought up to date by Broyden's rule and
  /// made anew where steps no longer gain what they promise, as long as that pays. Nothing
  /// where no state of a start could be simulated.
  [[nodiscard]] std::vector<std::optional<Refit>> fit_all(std::vector<RefitStart> starts) const;
  /// One of them. Throws Error(kCompute) where it cannot be simulated.
  [[nodiscard]] Refit fit(RefitStart start) const;

  [[nodiscard]] const Whitening& whitening() const { return whitening_; }
  /// How large a model's corrections are.
  struct Corrections {
    /// The factor with which the stated deviations of Model::corrections() are likeliest:
    /// a cause that explains what they made up for leaves small ones, and what nothing explains is
    /// the solver's. 1 without any.
    double size = 1.0;
    /// −2 ln of the model's evidence with that size over that with Noise::corrections, which serve
    /// all models, beside the refit's deviance.
    double term = 0.0;
  };
  /// They follow from the evidence, all numbers integrated out (Laplace; MacKay 1992), to
  /// first order, so that it may have been searched with another size.
  [[nodiscard]] Corrections corrections_of(const Refit& refit) const;
  /// Derivative of the prediction by the bias's amplitude, stacked; no rows where there is none.
  [[nodiscard]] const Eigen::VectorXd& bias() const { return bias_; }
  [[nodiscard]] const Study& study() const { return *study_; }
  /// Whether RefitOptions::most_runs are used up. Who leaves something undone for it marks the
  /// study as cut.
  [[nodiscard]] bool spent() const { return study_->search_work() >= options_.most_runs; }
  /// Noise::corrections
  [[nodiscard]] double corrections() const { return corrections_; }

 private:
  struct Place;
  class Search;
  /// `corrections`: Refit::corrections.
  [[nodiscard]] Place place(const State& state, double bias, const Eigen::VectorXd& seen,
                            double corrections) const;
  /// The residual at a place: `white`, the whitened one of the rows, then the priors'.
  [[nodiscard]] Eigen::VectorXd with_priors(const Eigen::VectorXd& white, const State& state,
                                            double bias, double corrections) const;
  /// [θ | α] derivatives at a state, in scales. Columns of nuisances of known times are taken from
  /// `known` where it has any: they are the dearest and change least.
  [[nodiscard]] Eigen::MatrixXd slopes_at(const State& state, const Eigen::MatrixXd& known) const;
  /// Derivatives of Place::residual by [θ | α | bias], in scales; `state`: one with these causes.
  [[nodiscard]] Eigen::MatrixXd residual_slopes(const Eigen::MatrixXd& slopes, const State& state,
                                                double corrections) const;

  const Study* study_;
  RefitOptions options_;
  double corrections_;  ///< Noise::corrections
  Whitening whitening_;
  Eigen::VectorXd bias_;
};

/// The bias is about what the extrapolation says, to a standard deviation of as much: orders of
/// convergence between ½ and 2 lie within.
inline constexpr double kBiasMean = 1.0;
inline constexpr double kBiasSigma = 1.0;

}  // namespace matterfit::diagnose
