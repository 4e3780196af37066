// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "fit/search/equation_start.hpp"
#include "fit/search/flow_start.hpp"
#include "fit/search/law_state.hpp"
#include "fit/search/problems.hpp"
#include "fit/search/stages.hpp"
#include "fit/search/start_limit.hpp"

namespace matterfit::fit {

/// Looks for the values where a search begins: the initial motion in closed form; where that start
/// is poor the momentum balance of the tracks and, if that leaves it poor, a scan of simulations.
/// The solver chooses its substeps here. Throws
/// Error(kCancelled).
class StartSearch {
 public:
  /// Told what is done, how much of it (0 to 1), and how near it came [m]; NaN: not known.
  using Tell =
      std::function<void(const LawState& state, const std::string& what, double part, double rms)>;

  /// All but `tell` is borrowed.
  StartSearch(SearchProblems& problems, const std::vector<SearchStage>& stages,
              const Interrupter& interrupter, Tell tell);

  /// Where the search begins, and at which level.
  void begin(LawState& state);
  /// Looks once more along each parameter from where the first stage ended (where the first motion
  /// was not known, the first level): it may lie in a wrong valley. True if something better was
  /// found.
  [[nodiscard]] bool rescan(LawState& state);
  /// Begins with a finer level where the state's one does not show the motion: where what the finer
  /// one makes of the same values differs by much of what they are off. A coarse grid is stiff and
  /// viscous by itself, and a search there makes up for it. True if it does.
  bool skip_level(LawState& state);
  /// Where a finer level begins: with the material of the coarser one, or with one of those that
  /// were tried as a start, whichever is nearest there. A coarse grid is viscous by itself, and a
  /// fit there makes up for it. A second start stays what it is.
  void choose_material(LawState& state);

 private:
  /// Where a search may begin.
  struct Start {
    std::vector<double> values;
    double mean = 0.0;     ///< distance from the capture [m]
    bool scanned = false;  ///< it was poor, and so was what the momentum balance gives
    std::string statement;
  };

  /// Replaces the material of a start by one that misses less: of the momentum balance or, if that
  /// is poor, of a scan.
  void find_material(LawState& state, const Window& window, const StartLimit& limit,
                     const EquationStart& balance, Start& start);
  /// A start in the nearest class of flow; the second one is for a search that ends far off.
  void take_flow(LawState& state, std::vector<FlowFound> found, Start& start) const;
  /// `values` with the law's parameters of `material`, a code's among them.
  [[nodiscard]] std::vector<double> with_law_of(std::vector<double> values,
                                                const std::vector<double>& material) const;
  /// Mean distances of simulations at a level (without one: that of the first stage) [m].
  [[nodiscard]] std::vector<double> mean_distances(LawState& state,
                                                   const std::vector<std::vector<double>>& points,
                                                   const Window& window, double level);
  [[nodiscard]] std::vector<double> mean_distances(LawState& state,
                                                   const std::vector<std::vector<double>>& points,
                                                   const Window& window);
  /// mean_distances() of a scan; infinite, without a simulation, beyond the limit.
  [[nodiscard]] std::vector<double> start_distances(LawState& state, const StartLimit& limit,
                                                    const std::vector<std::vector<double>>& points,
                                                    const Window& window);

  SearchProblems& problems_;
  const std::vector<SearchStage>& stages_;
  const Interrupter& interrupter_;
  Tell tell_;
  /// The best of the points that mean_distances() tried last [m], for progress.
  double told_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace matterfit::fit
