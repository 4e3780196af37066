// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "fit/model/experiment.hpp"
#include "job/documents/capture_scene.hpp"

namespace matterfit::job {

/// What a job says of one run of its experiment.
struct RunSource {
  SceneGroup group;
  Json overrides;  ///< of a scene of its own; null: none
  Job job;         ///< its scene and captures alone
};

/// A job's scenes and captures, as documents and as an experiment; one source a run.
struct LoadedExperiment {
  std::vector<RunSource> sources;
  fit::Experiment experiment;
};

/// The runs of a job with their captures by name only: nothing is read.
[[nodiscard]] LoadedExperiment unread_experiment(const Job& job);

/// Reads the captures of a job, marks what the fit may look at, and refuses a hold-out that leaves
/// nothing (with `others` that are fitted too only of a capture) or takes where the points are at
/// rest. A point that is first seen once the
/// body moves, and has no place in `positions`, has no `rest` and is left out; one whose rest alone
/// is held out counts as held out. What is odd and no error goes into `statements`. Throws
/// Error(kInput) beginning with the capture's path.
[[nodiscard]] LoadedExperiment load_experiment(const Job& job, std::vector<std::string>& statements,
                                               bool others = false);

/// Settles the noise of all captures, and refuses captures of other bodies (fit/data/
/// capture_noise.hpp). `scenes` one a run, of level 1.
void settle_captures(fit::Experiment& experiment, const std::vector<mpm::Scene>& scenes,
                     Arena& arena, std::vector<std::string>& statements);

/// Both, with the scenes built once for it: all that fit::Predictor asks for. `threads` as
/// RunOptions has them.
[[nodiscard]] LoadedExperiment prepare_experiment(const Job& job, int threads,
                                                  const Interrupter& interrupter,
                                                  std::vector<std::string>& statements);

/// Builds the scene of a job at any level.
[[nodiscard]] fit::SceneBuilder scene_builder(Job job);

}  // namespace matterfit::job
