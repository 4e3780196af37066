// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "capture/tracks.hpp"
#include "fit/data/camera_pose.hpp"
#include "fit/data/cloud_residuals.hpp"

/// Recordings as fits, comparisons and diagnoses look at them.
namespace matterfit::fit {

/// The frames of a scene.
struct Clock {
  double fps = 24.0;
  int first_frame = 0;
  int end_frame = 1;  ///< half-open

  /// The last frame [s after the first].
  [[nodiscard]] double end() const { return (end_frame - 1 - first_frame) / fps; }
};

/// When and how a recording is looked at: what of an experiment is no part of the scene.
struct Viewing {
  double start_frame = 0.0;       ///< scene frame of the recording's time 0
  std::vector<CameraPose> poses;  ///< of a recording by images, one a camera; of others none
};

/// A recording in the world, in the scene's seconds.
struct CaptureInput {
  std::string name;
  std::string body;
  capture::Tracks tracks;  ///< times are seconds after the scene's first frame
  Points rest;             ///< (N) where the points are on the body at rest; NaN: not known
  std::vector<std::size_t>
      rest_samples;  ///< (N) that `rest` is the mean of; 0: given, or not known
  /// Unit: the one point is no place on the body, but the farthest of it that way; what is across
  /// was not measured and stays as in `rest`.
  std::optional<Vec3d> front;
  std::optional<double> release;              ///< [s]; before it is the quiet time
  double start = 0.0;                         ///< scene seconds of the recording's time 0
  std::vector<std::uint8_t> held_out_points;  ///< (N)
  std::vector<std::uint8_t> held_out_frames;  ///< (T)
  bool aligned = false;
  std::vector<double> alignment_residual_mm;  ///< of each marker that took part
  double alignment_rms_mm = 0.0;

  /// The points' name, or their index as text.
  [[nodiscard]] std::string label(std::size_t point) const;
};

/// A recording with what a fit may look at of it.
struct Capture {
  std::string path;  ///< in the document, for messages
  CaptureInput input;
  Viewing viewing;                 ///< as the document says
  bool places_given = false;       ///< `rest` was given: it moves with a body that is placed anew
  bool clouds = false;             ///< point i of one frame is not point i of another
  std::vector<std::uint8_t> used;  ///< (T, N) 1: seen, not held out, in the simulated time, moving
  std::vector<std::uint8_t> predicted;  ///< (T, N) the same of what is held out
  std::vector<double> sigma;            ///< (N) standard deviation of a coordinate [m]
  double begin = 0.0;                   ///< from here on it moves [s after the scene's first frame]
  double end = 0.0;                     ///< the last sample that is used [s]
  std::size_t used_count = 0;

  [[nodiscard]] bool held_out(std::size_t frame, std::size_t point) const {
    return input.held_out_points[point] != 0 || input.held_out_frames[frame] != 0;
  }
  /// Standard deviation of a coordinate of what a simulation of the truth misses a point by [m]:
  /// its noise and, where that point's place on the body is known from noisy samples, theirs.
  [[nodiscard]] double deviation(std::size_t point) const;
  /// Frames with a used sample, ascending.
  [[nodiscard]] std::vector<std::size_t> used_frames() const { return frames_in(used); }
  /// Frames with a sample of the mask (T, N), ascending.
  [[nodiscard]] std::vector<std::size_t> frames_in(const std::vector<std::uint8_t>& mask) const;
  /// Points of a frame that are compared, ascending: those of the mask; of a cloud of many a draw.
  [[nodiscard]] std::vector<std::size_t> compared(std::size_t frame,
                                                  const std::vector<std::uint8_t>& mask) const;
  /// How clouds are compared, from the first frame of the mask; there is one, and noise is settled.
  [[nodiscard]] CloudScale cloud_scale(const std::vector<std::uint8_t>& mask) const;
  [[nodiscard]] CloudScale cloud_scale() const { return cloud_scale(used); }
};

}  // namespace matterfit::fit
