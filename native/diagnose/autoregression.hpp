// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace matterfit::diagnose {

/// Beyond it a stationary part cannot be told from a constant within a clip.
inline constexpr double kHighestCorrelation = 0.98;

/// A stationary AR(1).
struct Autoregression {
  double sigma = 0.0;
  double correlation = 0.0;  ///< from one sample to the next
  double freedom = 1.0;      ///< degrees of freedom in which sigma was seen
  /// Correlations at the middle of each fifth of its posterior.
  std::vector<double> plausible;
};

/// A matrix whose last column is the data: what its Gram matrix is after AR(1) whitening with any
/// correlation φ is a quadratic polynomial of φ.
class Moments {
 public:
  /// `chains`: rows of each in time, a frame's interval apart; `lost`: degrees of freedom that the
  /// rows no longer have.
  Moments(const Eigen::MatrixXd& rows, const std::vector<std::vector<Eigen::Index>>& chains,
          double lost = 0.0);

  struct Likelihood {
    double value = 0.0;  ///< ln, restricted, up to a constant
    double sigma = 0.0;  ///< where it is largest
    double freedom = 1.0;
  };
  [[nodiscard]] Likelihood at(double phi) const;

 private:
  Eigen::MatrixXd first_;
  Eigen::MatrixXd later_;
  Eigen::MatrixXd before_;
  Eigen::MatrixXd cross_;
  double steps_ = 0.0;
  double size_ = 0.0;
};

/// Restricted maximum likelihood for sigma, and the correlation's mean over its posterior from
/// `lowest` on: of a flat prior, or of a normal one about `expected`.
[[nodiscard]] Autoregression fit_autoregression(const Moments& moments, double lowest,
                                                std::optional<double> expected = {});

/// An AR(1) from which a constant of each series was taken out comes out too small (Kendall 1954);
/// `frames` of a series.
void correct_for_constants(double frames, Autoregression& fit);

}  // namespace matterfit::diagnose
