// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "fit/data/cloud_residuals.hpp"
#include "job/documents/capture_scene.hpp"
#include "job/run/capture_input.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// A capture as a fit sees it.
struct FitCapture {
  std::string path;  ///< in the document
  CaptureInput input;
  bool places_given = false;       ///< `positions` of the document: they move with the body
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
  /// its noise and, where that point's place on the body is told by noisy samples, theirs.
  [[nodiscard]] double deviation(std::size_t point) const;
  /// Frames with a used sample, ascending.
  [[nodiscard]] std::vector<std::size_t> used_frames() const;
  /// Points of a frame that are compared, ascending: those that are used; of a cloud of many a
  /// draw.
  [[nodiscard]] std::vector<std::size_t> compared(std::size_t frame) const;
  /// Of a cloud, from the first frame that is used; there is one, and noise is settled.
  [[nodiscard]] fit::CloudScale cloud_scale() const;
};

/// One scene of a fit with the captures that are compared with it. Runs without a used sample are
/// simulated for their prediction only.
struct FitRun {
  SceneGroup group;
  Json overrides;  ///< of a scene of its own; null: none
  Job job;
  std::vector<FitCapture> captures;
  bool fitted = false;  ///< some of its samples are used
};

/// Reads the captures of a job, marks what the fit may look at, and refuses a hold-out that leaves
/// nothing, or that holds out where the points are at rest. A point that is first seen once the
/// body moves, and has no place in `positions`, has no `rest` and is left out; one whose rest alone
/// is held out counts as held out. What is odd and no error goes into `statements`. Throws
/// Error(kInput) beginning with the capture's path.
[[nodiscard]] std::vector<FitRun> load_fit_runs(const Job& job,
                                                std::vector<std::string>& statements);

/// σ of every point: the job's or the file's noise; where that is 0 or missing the capture's own
/// estimate from samples that are not held out, where there is none, and for clouds, 1e-3 of the
/// body's size.
void settle_noise(FitRun& run, const mpm::Scene& scene, std::vector<std::string>& statements);

/// States of each cloud how it is compared, and what its points alone make of that; noise settled.
void describe_clouds(const FitRun& run, std::vector<std::string>& statements);

/// Whether a capture can be of this body: where more than 5 % of its points lie farther than two
/// particle separations off it at rest there is a statement; beyond a quarter of the body's size as
/// well Error(kInput).
void check_places(const FitRun& run, const mpm::Scene& scene, Arena& arena,
                  std::vector<std::string>& statements);

}  // namespace matterfit::job
