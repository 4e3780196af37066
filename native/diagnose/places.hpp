// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "base/vec.hpp"
#include "diagnose/rows.hpp"

/// A track's place on the body may be known to the noise of one frame only: that error stays with
/// the track and turns with the body.
namespace matterfit::diagnose {

/// Rotation of the body since rest, of each capture and frame.
using Turns = std::vector<std::vector<Mat3d>>;

/// The rotations that take the tracks' rest places closest to where a motion has them (Kabsch
/// 1976); the identity where fewer than three tracks of a frame are among the rows, and in captures
/// of which not all axes were measured. `positions`: of the rows [m].
[[nodiscard]] Turns body_turns(const Rows& rows, const std::vector<Capture>& captures,
                               const Eigen::VectorXd& positions);

/// The rows of one track, and how a shift of its place moves them: rows × 3.
struct TrackRows {
  int capture = 0;
  std::vector<std::pair<Eigen::Index, Eigen::Index>> segments;  ///< [begin, end) of rows
  Eigen::MatrixXd shift;

  [[nodiscard]] Eigen::MatrixXd gather(const Eigen::MatrixXd& columns) const;
  void scatter(const Eigen::MatrixXd& values, Eigen::MatrixXd& columns) const;
};

[[nodiscard]] std::vector<TrackRows> track_rows(const Rows& rows, const Turns& turns);

}  // namespace matterfit::diagnose
