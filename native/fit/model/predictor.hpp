// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "base/interrupter.hpp"
#include "fit/model/experiment.hpp"
#include "fit/model/model.hpp"
#include "fit/model/parameters.hpp"
#include "mpm/scene.hpp"

namespace matterfit::fit {

/// What is to be predicted: values and variations, at a resolution.
struct Ask {
  Query query;
  double level = 1.0;  ///< the particle separation over the scene's, at least 1
};

/// An experiment that can be simulated: at any values of the parameters and of any other quantity,
/// at any resolution, offset of the grid and time step. Scenes are built once a level.
class Predictor {
 public:
  /// `experiment` and `interrupter` are borrowed. `builders`: one a run, in place of Run::build;
  /// empty: none. Builds the scenes of level 1. Throws Error(kInput), Error(kCancelled), and what
  /// Parameters throws.
  Predictor(const Experiment& experiment, const std::vector<ParameterSpec>& specs,
            const Model::Options& options, const Interrupter& interrupter,
            std::vector<SceneBuilder> builders = {});

  [[nodiscard]] const std::vector<Run>& runs() const { return experiment_.runs; }
  [[nodiscard]] const Parameters& parameters() const { return *parameters_; }
  /// The scenes of level 1, as they were built.
  [[nodiscard]] const std::vector<mpm::Scene>& scenes() const { return scenes_; }
  /// The model of a level, which is made at the first call: not to be called from several threads
  /// at once. What it returns stays.
  [[nodiscard]] const Model& model(double level = 1.0);

  /// Simulates every run to its end and sees it at all samples of all captures, used and held out:
  /// one outcome an ask, in their order; nothing where it could not be completed. Positions are NaN
  /// outside the simulated time. The solver chooses its substeps. Throws Error(kCancelled).
  [[nodiscard]] Evaluation predict(const std::vector<Ask>& asks, bool velocities = false,
                                   const std::function<void(double)>& progress = {});

 private:
  const Experiment& experiment_;
  Model::Options options_;
  const Interrupter& interrupter_;
  std::vector<SceneBuilder> builders_;
  std::vector<mpm::Scene> scenes_;
  std::unique_ptr<Parameters> parameters_;
  std::map<double, std::unique_ptr<Model>> models_;  ///< by level
};

}  // namespace matterfit::fit
