// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "fit/data/capture.hpp"
#include "fit/model/own_splats.hpp"
#include "fit/model/quantity.hpp"
#include "mpm/scene.hpp"

namespace matterfit::fit {

/// A run's scene with its particle separation times `level`, at least 1; 1 is the scene's own.
/// Called once a level. Throws Error(kInput), Error(kCancelled).
using SceneBuilder =
    std::function<mpm::Scene(double level, Arena& arena, const Interrupter& interrupter)>;

/// A recording by images: what a fit moves of how it is looked at. Its images are no matter of a
/// run (fit/model/image_problem.hpp).
struct Film {
  std::string name;
  Viewing viewing;  ///< as the document says, with a pose for each camera
};

/// One scene with the recordings that are compared with it. Runs without a used sample are
/// simulated for their prediction only.
struct Run {
  SceneBuilder build;
  Clock clock;
  Origins origins;  ///< of the scene's bodies
  std::vector<Capture> captures;
  std::vector<Film> films;
  std::vector<BodySplats> splats = {};  ///< that bodies of the scene are drawn by, of level 1
  bool fitted = false;                  ///< some samples are used
  /// The scene is that of these captures alone; `sets` says whether it sets a quantity by itself,
  /// so that a number of all scenes leaves it as it is.
  bool own = false;
  std::function<bool(const Address&)> sets = {};
};

/// What is known of a thing that was recorded: everything that a fit, a check or a diagnosis
/// simulates and compares.
struct Experiment {
  std::vector<Run> runs;
};

}  // namespace matterfit::fit
