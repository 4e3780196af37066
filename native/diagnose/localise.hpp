// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnose/noise.hpp"
#include "diagnose/report.hpp"
#include "diagnose/spread.hpp"
#include "diagnose/study.hpp"

namespace matterfit::diagnose {

/// Root mean square and 95 % quantile of distances over the rows' samples [m].
[[nodiscard]] Sizes sizes_of(const Rows& rows, const Eigen::VectorXd& residual);

/// Errors of every frame, used and held out, of a stacked residual [m], beside what noise and the
/// solver's spread make. `solver`: Spread::deviations(), stacked.
[[nodiscard]] std::vector<FrameError> errors_by_frame(const Study& study,
                                                      const Eigen::VectorXd& residual,
                                                      const Noise& noise,
                                                      const Eigen::MatrixXd& solver);

/// The `count` frames whose worst track is farthest off, at most one of any five neighbours.
[[nodiscard]] std::vector<WorstFrame> worst_frames(const Study& study,
                                                   const Eigen::VectorXd& residual,
                                                   std::size_t count);

/// Frames × body regions whose mean residual is more than noise and the solver make, with 5 % of
/// false discoveries at most (Benjamini and Hochberg 1995). Used rows.
[[nodiscard]] std::vector<WrongPlace> wrong_places(const Study& study,
                                                   const Eigen::VectorXd& residual,
                                                   const Noise& noise,
                                                   const Eigen::MatrixXd& solver);

}  // namespace matterfit::diagnose
