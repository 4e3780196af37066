// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "job/run/capture_input.hpp"
#include "job/run/excited_range.hpp"
#include "job/run/run_options.hpp"

namespace matterfit::job {

/// What a caller adds to the run of one scene.
struct RunExtras {
  std::string_view task;  ///< that the result names; empty: the job's
  bool clouds = false;    ///< of captures: capture::TracksOptions::clouds
  bool images = true;     ///< a comparison looks at captures by images too
  double begin = 0.0;     ///< where the progress of this run begins
  /// Files that stay in the folder although an earlier manifest lists them.
  std::vector<std::string> kept;
  /// Called with the errors of every capture of a comparison; `body_size` [m].
  std::function<void(const fit::CaptureInput&, const std::vector<double>& error_mm,
                     double body_size)>
      compared;
  /// Called for the run, and for each run of a capture's own scene, with what its bodies go
  /// through.
  std::function<void(const Job&, const ExcitedRange&)> strained;
  /// Called with the result before it is written; returns files in the folder that are then listed
  /// in the manifest.
  std::function<std::vector<std::string>(Json& result)> finish;
};

/// Runs one scene to its end: simulate, compare or bake. Captures must not have scenes of their
/// own.
[[nodiscard]] Json run_scene(const Job& job, const RunOptions& options, Interrupter& interrupter,
                             const RunExtras& extras);

/// Runs a job with those scenes that captures have of their own: each in `runs/NAME` of the output
/// folder, states and comparisons; their captures join the result's, `runs` names them.
[[nodiscard]] Json run_scenes(const Job& job, const RunOptions& options, Interrupter& interrupter,
                              const RunExtras& extras);

}  // namespace matterfit::job
