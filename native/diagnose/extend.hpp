// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "diagnose/analysis.hpp"
#include "diagnose/free_law.hpp"
#include "diagnose/spread.hpp"
#include "diagnose/trials.hpp"

namespace matterfit::diagnose {

struct ExtendOptions {
  AnalysisOptions analysis;
  RefitOptions refit;
  GainOptions gain;
  int refits = 10;      ///< single causes refitted at most
  int most_causes = 3;  ///< that are named together
  /// p below which a further cause is looked into: stricter than for the first, because what the
  /// first leaves by its own curvature must not be named.
  double further_level = 0.01;
  std::function<void(double, const std::string&)> progress;  ///< fraction, what is being done
};

/// All that was learnt on the way from the fitted model to the best extension.
struct Extension {
  Noise noise;
  Spread spread;
  State base_state;              ///< where the search began
  bool began_elsewhere = false;  ///< Approach::elsewhere
  Linearised slopes;             ///< there
  Trial base;                    ///< nothing added, refitted under the noise
  std::optional<Analysis> first;
  std::vector<Trial> singles;       ///< smallest evidence first
  std::vector<std::size_t> rivals;  ///< scores (indices) of candidates not excluded by the best
  std::optional<Trial> best;        ///< of all, with as many causes as are needed
  std::optional<Analysis> last;     ///< at `best`
  double looseness =
      1.0;  ///< χ²/dof of the best model, at least 1: what likelihoods are divided by
  bool accepted = false;  ///< the best passes significance, gain, baselines and bounds
  /// The best extension takes away no more than the estimate of the solver's error may be off by.
  bool within_solver = false;
  bool exact_solver_significant = false;  ///< something is wrong if the solver counts as exact
  std::optional<FreeLaw> law;
};

/// Steps 2 to 8 and 10 of a diagnosis: covariance, scores, refits of the best candidates and what
/// is like them, a second and third cause, the gain on unseen samples, and the law freed last.
[[nodiscard]] Extension extend(const Study& study, int members, const ExtendOptions& options);

}  // namespace matterfit::diagnose
