// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "diagnose/gain.hpp"
#include "diagnose/refit.hpp"
#include "diagnose/spread.hpp"

namespace matterfit::diagnose {

/// Judges refitted models on samples that they did not see: the captures' held-out ones, or, where
/// nothing was held out, the last quarter of the used frames, with every model refitted to the
/// rest.
class Judge {
 public:
  /// `study` and `noise` outlive it. `theta`: derivatives at the base, stacked, in scales.
  Judge(const Study& study, const Noise& noise, const Spread& spread, const Eigen::MatrixXd& theta,
        const RefitOptions& options);

  /// What a model gets wrong there.
  struct Opinion {
    Eigen::VectorXd residual;  ///< held-out rows [m]
    /// χ² of it, with the errors of θ in the covariance; 0 where the samples were also fitted to
    /// (nothing was held out), because it is then no new evidence.
    double deviance = 0.0;
    std::map<BlockKey, double> blocks;  ///< that χ² by block; empty where it is 0
    Eigen::VectorXd stacked;            ///< the residual of the rows fitted to, then that
  };
  /// An opinion of each model, in order.
  [[nodiscard]] std::vector<Opinion> judge(std::span<const Refit* const> refits) const;

  /// Gain of `after` over `before`; the free field has `numbers` numbers.
  [[nodiscard]] Gain gain_of(const Opinion& before, const Opinion& after, int numbers,
                             const GainOptions& options) const;
  [[nodiscard]] const Rows& rows() const { return study_->held(); }

 private:
  [[nodiscard]] State settle(const State& state) const;
  /// Predictions of the rows fitted to, then of those kept back.
  [[nodiscard]] std::vector<Eigen::VectorXd> predictions(
      std::span<const Refit* const> refits) const;
  std::unique_ptr<Study> split_;        ///< where nothing was held out
  std::unique_ptr<Refitter> refitter_;  ///< on its rows
  const Study* study_;
  std::vector<Eigen::Index> places_;  ///< of its rows among those of the study that was given
  Noise fit_noise_;
  Noise held_noise_;
  Eigen::MatrixXd theta_;        ///< stacked
  Eigen::MatrixXd held_solver_;  ///< Spread::deviations() at held-out rows
  std::optional<Whitening> whitening_;
  std::optional<Whitening> used_whitening_;
  std::vector<Eigen::Index> own_;  ///< parameters of captures that are held out whole
  DifferenceOptions differences_;
};

/// Where the samples of `to` stand among those of `from`, of which they are a part.
[[nodiscard]] std::vector<Eigen::Index> places_in(const Rows& from, const Rows& to);

}  // namespace matterfit::diagnose
