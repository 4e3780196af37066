// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/interrupter.hpp"
#include "fit/model/capture_problem.hpp"
#include "fit/model/predictor.hpp"
#include "fit/search/search_options.hpp"

namespace matterfit::fit {

/// What the fit of one law needs to know.
struct SearchSetup {
  SearchOptions options;
  const Experiment* experiment = nullptr;
  /// One a run: its scene with this law's material.
  std::vector<SceneBuilder> builders;
  material::Law law = material::Law::kFixedCorotated;
  std::vector<ParameterSpec> parameters;
  mpm::SimdTarget target = mpm::SimdTarget::kAuto;
  int threads = 0;
  double memory_limit_gb = 8.0;
};

/// What the fit of one law compares: its scenes at any level with its captures over any window, and
/// by how much they may differ.
class SearchProblems {
 public:
  /// Builds the scenes at the document's resolution. Throws Error(kInput), Error(kCancelled).
  SearchProblems(SearchSetup setup, const Interrupter& interrupter);

  [[nodiscard]] const SearchSetup& setup() const { return setup_; }
  [[nodiscard]] const Parameters& parameters() const { return predictor_.parameters(); }
  /// The scenes of the runs at the document's resolution.
  [[nodiscard]] const std::vector<mpm::Scene>& scenes() const { return predictor_.scenes(); }
  [[nodiscard]] const std::vector<Run>& runs() const { return predictor_.runs(); }
  [[nodiscard]] Predictor& predictor() { return predictor_; }
  [[nodiscard]] const Model& model(double level) { return predictor_.model(level); }
  /// The residuals of all used samples at a level.
  [[nodiscard]] CaptureProblem problem(double level, const Window& window,
                                       const std::vector<Parameter>& parameters);
  [[nodiscard]] CaptureProblem problem(double level, const Window& window) {
    return problem(level, window, parameters().parameters());
  }
  /// The mean distance beyond which a start is poor, and that beyond which an end is far off [m].
  [[nodiscard]] double poor() const;
  [[nodiscard]] double far() const;
  /// What clouds of one body miss each other by in the mean [m].
  [[nodiscard]] double alike() const;

 private:
  SearchSetup setup_;
  Predictor predictor_;
};

/// The mean of distances; 0 of none.
[[nodiscard]] double mean_value(const std::vector<double>& distances);

}  // namespace matterfit::fit
