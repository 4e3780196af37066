// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnose/noise.hpp"
#include "diagnose/rows.hpp"

namespace matterfit::diagnose {

/// Σ^−½ for Σ = Σ_own + U Uᵀ: Σ_own is the AR(1) of each series with the errors of the track's
/// place, the columns of U are the shared part of the noise and, given by the caller, the solver's
/// own spread. The first is whitened by recursion and three directions a track, the second by the
/// eigenvectors of Vᵀ V, V = Σ_own^−½ U (Woodbury), so that a thousand tracks cost no dense matrix
/// of all rows.
class Whitening {
 public:
  /// `spread`: further columns of U, rows × members [m]; may have none.
  Whitening(const Rows& rows, const Noise& noise, const Eigen::MatrixXd& spread);

  /// Σ^−½ of every column.
  [[nodiscard]] Eigen::MatrixXd apply(const Eigen::MatrixXd& columns) const;
  /// Covariance of Xᵀ e, X = Σ^−½ᵀ `white`, where the own part's correlation is the n-th plausible
  /// one instead of the estimate that was whitened with.
  [[nodiscard]] Eigen::MatrixXd covariance_if(const Eigen::MatrixXd& white, std::size_t n) const;

 private:
  /// A track whose place has an error: directions of the whitened rows and how much is taken out.
  struct Place {
    TrackRows track;  ///< `shift` in metres
    Eigen::MatrixXd vectors;
    Eigen::Vector3d shrink;
  };
  void find_places();
  void take_places(Eigen::MatrixXd& columns) const;
  /// Whitens rows [begin, end), one series of a capture, by its AR(1).
  void recursion(int capture, Eigen::Index begin, Eigen::Index end, Eigen::MatrixXd& x) const;
  [[nodiscard]] Eigen::MatrixXd own(Eigen::MatrixXd columns) const;
  [[nodiscard]] Eigen::MatrixXd own_transposed(Eigen::MatrixXd columns) const;
  [[nodiscard]] Eigen::MatrixXd low_rank(const Eigen::MatrixXd& columns) const;
  [[nodiscard]] double step_correlation(double correlation, const TrackNoise& noise,
                                        Eigen::Index row) const;

  Rows rows_;
  Noise noise_;
  std::vector<Place> places_;
  Eigen::MatrixXd factor_;   ///< U
  Eigen::MatrixXd vectors_;  ///< orthonormal
  Eigen::VectorXd shrink_;   ///< 1 − 1/√(1 + s²)
};

}  // namespace matterfit::diagnose
