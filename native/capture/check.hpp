// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "capture/tracks.hpp"

namespace matterfit::capture {

/// A step of one point that does not fit its own motion before and after.
struct Jump {
  std::size_t point = 0;
  std::size_t frame = 0;  ///< index of the frame at the far end of the step
  double size = 0.0;      ///< deviation from the motion of its neighbours in time [m]
};

/// A span of time in which the capture has no frame.
struct TimeGap {
  std::size_t frame = 0;  ///< index of the frame after the gap
  double seconds = 0.0;
};

/// What a capture is like, for the panel and for choosing tolerances.
struct CaptureSummary {
  std::size_t frames = 0;
  std::size_t points = 0;
  double duration = 0.0;      ///< [s]
  double spacing = 0.0;       ///< median time between frames [s]
  std::size_t irregular = 0;  ///< steps of time off the median by more than 1 %
  std::vector<TimeGap> gaps;  ///< steps of at least 1.5 medians
  Vec3d low = Vec3d::Zero();  ///< bounding box of all visible positions [m]
  Vec3d high = Vec3d::Zero();
  std::string unit_warning;  ///< "looks like millimetres …", or empty
  std::vector<Jump> jumps;   ///< the largest first, 20 at most
  std::size_t jump_count = 0;
  /// Frames that move smoothly once each is exchanged with the one after it, and do not as they
  /// are; not known for the first frame and the last.
  std::vector<std::size_t> exchanged;
  std::string exchanged_warning;           ///< a sentence, or empty
  double missing = 0.0;                    ///< fraction of samples that are not visible
  std::vector<std::size_t> never_visible;  ///< points seen in no frame
  /// Standard deviation of one coordinate [m], from third differences in time (their MAD /
  /// (0.6745 √20)) over the quieter half of the clip; 0 with fewer than 4 frames in a row. Motion
  /// that third differences do not remove (vibration near the frame rate) adds to it: noise is at
  /// most this.
  double noise = 0.0;
  std::vector<double> point_noise;  ///< the same for each point, (N,)
  std::vector<std::string> text;    ///< lines for the panel, in the order above
};

/// What a sequence of point clouds is like.
struct CloudSummary {
  std::size_t frames = 0;
  std::size_t fewest = 0;  ///< points in a frame
  std::size_t most = 0;
  double duration = 0.0;  ///< [s]
  double spacing = 0.0;   ///< median time between frames [s]
  std::size_t irregular = 0;
  std::vector<TimeGap> gaps;
  std::vector<std::size_t> empty_frames;
  Vec3d low = Vec3d::Zero();  ///< bounding box of all points [m]
  Vec3d high = Vec3d::Zero();
  std::string unit_warning;
  std::vector<std::string> text;
};

[[nodiscard]] CloudSummary summarise(const PointCloudSequence& clouds);

/// Throws Error(kInput) as check_tracks() does.
[[nodiscard]] CaptureSummary summarise(const Tracks& tracks);

}  // namespace matterfit::capture
