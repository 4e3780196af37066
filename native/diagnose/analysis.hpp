// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnose/noise.hpp"
#include "diagnose/placebo.hpp"
#include "diagnose/scores.hpp"
#include "diagnose/spread.hpp"
#include "diagnose/study.hpp"
#include "diagnose/whitening.hpp"

namespace matterfit::diagnose {

struct AnalysisOptions {
  PlaceboOptions placebo;
  int cosines = 4;  ///< of the smooth residual that is tested for something unknown
};

/// The residual's smooth part (smooth_basis()): what is there whatever its cause.
struct SmoothTest {
  double statistic = 0.0;
  int freedom = 0;
  double p = 1.0;
  /// Beyond what noise makes.
  [[nodiscard]] double excess() const { return statistic > freedom ? statistic - freedom : 0.0; }
};

/// Scores of all candidates at one state, under one covariance, with their placebo.
struct Analysis {
  ScoreTest test;
  Eigen::VectorXd numerators;
  std::vector<Score> scores;
  Placebo placebo;
  SmoothTest smooth;
  Eigen::MatrixXd signatures;  ///< M J, whitened rows × columns: what is left of each
  Eigen::VectorXd residual;    ///< whitened
};

/// `prediction`: stacked, with the bias already at work by the amplitude `bias`. Without spread the
/// solver counts as exact.
[[nodiscard]] Analysis analyse(const Study& study, const State& state, const Linearised& slopes,
                               const Spread& spread, const Noise& noise,
                               const Eigen::VectorXd& prediction, double bias,
                               const AnalysisOptions& options);

/// Columns that the noise of `residual` is not estimated from: of all parameters, causes and the
/// solver's error, and smooth ones; used rows. A cause has one shape at a time: the one of an
/// effect's that takes most away, beside the parameters.
[[nodiscard]] Eigen::MatrixXd explained_columns(const Study& study, const Linearised& slopes,
                                                const Spread& spread,
                                                const Eigen::VectorXd& residual);

/// T_k over a sliding window of frames, one value a frame and capture after capture: when the
/// evidence for a candidate arrives. `estimate`: α̂ in scales.
[[nodiscard]] std::vector<double> evidence_by_frame(const Study& study, const Analysis& analysis,
                                                    std::size_t k, const Eigen::VectorXd& estimate);

}  // namespace matterfit::diagnose
