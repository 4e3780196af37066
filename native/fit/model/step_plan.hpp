// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "mpm/scene.hpp"

namespace matterfit::fit {

/// The substeps of a run's frames throughout a search: those that the solver chose once, times a
/// power of 2^¼ where the material asks for more or allows less, so that small differences of the
/// parameters are not drowned by another sequence of substeps.
struct RunSteps {
  std::vector<int> substeps;  ///< of each frame; empty: the solver chooses
  double limit = 0.0;         ///< the estimated limit of stability where they were chosen [s]
  /// mpm::Scene::renewals of the same frames, so that slopes do not have the jumps of others;
  /// empty: of a run without renewed bodies, or of an older checkpoint.
  std::vector<std::vector<double>> renewals;
};

/// How every run of an evaluation is stepped. The solver chooses where there is no plan.
struct StepPlan {
  /// The refinement of a run whose substeps were never settled.
  static constexpr int kUnsettled = -64;

  std::vector<RunSteps> runs;    ///< one a run
  std::vector<int> refinements;  ///< least power of 2^¼ of each run

  StepPlan() = default;
  explicit StepPlan(std::vector<RunSteps> of_runs)
      : runs(std::move(of_runs)), refinements(runs.size(), kUnsettled) {}

  [[nodiscard]] bool holds(std::size_t run) const {
    return run < runs.size() && !runs[run].substeps.empty();
  }
  /// The factor on the substeps of a run for a scene. Throws Error(kCompute) where that is
  /// more than 32 times, as a run would take as many times as long.
  [[nodiscard]] double factor(std::size_t run, const mpm::Scene& scene) const;
  /// From here on the run takes no fewer substeps than this scene asks for, nor than `before` (an
  /// earlier entry of `refinements`; null: none) unless half as many would do: a search whose
  /// substeps change with every step compares costs that cannot be compared.
  void settle(std::size_t run, const mpm::Scene& scene, const int* before);
};

/// Each frame gets the most substeps of itself and the frames beside it: with values a little off a
/// body touches a collider a frame earlier or later, where contact asks for many more.
[[nodiscard]] std::vector<int> with_neighbours(const std::vector<int>& substeps);

/// Substeps times a factor, rounded up, at least one each.
[[nodiscard]] std::vector<int> multiplied(const std::vector<int>& substeps, double factor);

}  // namespace matterfit::fit
