// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "diagnose/model.hpp"

namespace matterfit::diagnose {

/// One coordinate of one track over time: rows [begin, end) of what Rows gathers.
struct Series {
  int capture = 0;
  Eigen::Index track = 0;
  int axis = 0;
  Eigen::Index begin = 0;
  Eigen::Index end = 0;
};

/// The coordinates of a motion that are looked at, one series after another.
class Rows {
 public:
  /// What selects a sample: capture, frame, track.
  using Select = std::function<bool(int capture, Eigen::Index frame, Eigen::Index track)>;
  /// Those that were measured and are selected. With more than `limit` rows whole tracks are left
  /// out, evenly over each capture's list; 0: no limit.
  Rows(const std::vector<Capture>& captures, const Select& select, Eigen::Index limit = 0);
  /// Those of one use.
  Rows(const std::vector<Capture>& captures, Use use, Eigen::Index limit = 0);

  [[nodiscard]] Eigen::Index size() const { return Eigen::Index(rows_.size()); }
  [[nodiscard]] const std::vector<Series>& series() const { return series_; }
  [[nodiscard]] Eigen::Index frame(Eigen::Index row) const { return frames_[std::size_t(row)]; }
  /// [s]
  [[nodiscard]] double time(Eigen::Index row) const { return times_[std::size_t(row)]; }
  /// The rows out of all coordinates of a motion (Motion::positions).
  [[nodiscard]] Eigen::VectorXd gather(const Eigen::VectorXd& motion) const;

 private:
  void add(const std::vector<Capture>& captures, const Select& select, Eigen::Index stride);
  std::vector<Series> series_;
  std::vector<Eigen::Index> rows_;
  std::vector<Eigen::Index> frames_;
  std::vector<double> times_;
};

/// Measured coordinates of all captures, in Motion's order [m].
[[nodiscard]] Eigen::VectorXd measured(const std::vector<Capture>& captures);

}  // namespace matterfit::diagnose
