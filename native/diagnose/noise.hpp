// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnose/places.hpp"
#include "diagnose/rows.hpp"

namespace matterfit::diagnose {

/// The tracker's noise in one capture: every coordinate of every track is a stationary AR(1) of its
/// own, and a second one is shared by all tracks at each time (a camera that shakes). Where a track
/// is on the body has an error that stays, as where a noisy frame said it, and turns with the body.
struct TrackNoise {
  double sigma = 0.0;               ///< standard deviation of a coordinate's own part [m]
  double correlation = 0.0;         ///< of that from one frame to the next
  double interval = 0.0;            ///< between frames, median [s]
  double common_sigma = 0.0;        ///< of the shared part [m]
  double common_correlation = 0.0;  ///< of that
  double place_sigma = 0.0;         ///< of a coordinate of a track's place on the body [m]
  double freedom = 1.0;             ///< degrees of freedom in which sigma was seen
  /// Correlations at the middle of each fifth of its posterior: how sure it is.
  std::vector<double> plausible;
  double kurtosis = 0.0;  ///< excess, of innovations; 0: normal
};

/// The noise of all captures, and which rows are outliers.
struct Noise {
  std::vector<TrackNoise> captures;
  /// One a row, in (0, 1]: rows whose innovation lies beyond four robust standard deviations are
  /// made lighter in proportion (Huber), so that heavy tails do not decide.
  Eigen::VectorXd weights;
  Turns turns;  ///< of the bodies; empty: places count as exact
  /// A factor on the deviations of Model::corrections(): how wrong the solver's impacts
  /// are beside what is stated.
  double corrections = 1.0;
};

/// Columns that a smooth unknown displacement could have: cosines over time (`cosines` of them, the
/// constant first) × {1, the body's coordinates at rest, and from 30 tracks on their products} ×
/// axes, capture by capture. Orthonormal within nothing: columns have unit norm.
[[nodiscard]] Eigen::MatrixXd smooth_basis(const Rows& rows, const std::vector<Capture>& captures,
                                           int cosines);

/// Estimates the noise from the residual r [m] (measured − simulated, one a row) in the complement
/// of `explained`: columns of what parameters, causes and smooth unknowns could make, so that a
/// discrepancy does not count as noise. Restricted maximum likelihood over the correlation
/// (Patterson and Thompson 1971); values that lie four robust standard deviations out are pulled in
/// first. The own part is seen in differences from the frame's mean, the shared part in the means,
/// from four tracks on; errors of places in what of a track's residual turns with the body.
/// `floor` [m] is the smallest standard deviation.
[[nodiscard]] Noise estimate_noise(const Rows& rows, const std::vector<Capture>& captures,
                                   const Eigen::VectorXd& residual,
                                   const Eigen::MatrixXd& explained, double floor,
                                   const Turns& turns = {});

/// Whether two estimates, of the same captures, differ by more than a tenth in size or correlation,
/// so that thresholds shift by as much.
[[nodiscard]] bool differ(const Noise& a, const Noise& b);

/// The same noise for other rows of the captures (held out), without outliers.
[[nodiscard]] Noise for_rows(const Noise& noise, const Rows& rows);

}  // namespace matterfit::diagnose
