// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "capture/tracks.hpp"
#include "job/documents/document.hpp"

namespace matterfit::job {

/// A capture as a run needs it: in the world, in the scene's seconds.
struct CaptureInput {
  std::string name;
  std::string body;
  capture::Tracks tracks;  ///< times are seconds after the scene's first frame
  Points rest;             ///< (N) where the points are on the body at rest; NaN: not known
  std::vector<std::size_t>
      rest_samples;               ///< (N) that `rest` is the mean of; 0: given, or not known
  std::optional<double> release;  ///< [s]; before it is the quiet time
  double start = 0.0;             ///< scene seconds of the capture's time 0
  std::vector<std::uint8_t> held_out_points;  ///< (N)
  std::vector<std::uint8_t> held_out_frames;  ///< (T)
  bool aligned = false;
  std::vector<double> alignment_residual_mm;  ///< of each marker that took part
  double alignment_rms_mm = 0.0;

  /// The points' name, or their index as text.
  [[nodiscard]] std::string label(std::size_t point) const;
};

/// Reads, aligns and times a capture of a job whose captures share its scene (job/documents/capture_scene.hpp
/// takes others apart). `clouds`: capture::TracksOptions::clouds. Throws Error(kInput) beginning
/// with the capture's path.
[[nodiscard]] CaptureInput load_capture(const Job& job, std::size_t index, bool clouds = false);

/// When the body is let go: the last release of its pins [s], if any is released in the scene.
[[nodiscard]] std::optional<double> body_release(const BodyDoc& body, const SceneDoc& scene);

}  // namespace matterfit::job
