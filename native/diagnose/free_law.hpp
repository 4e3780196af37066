// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "diagnose/judge.hpp"
#include "diagnose/scores.hpp"
#include "diagnose/trials.hpp"

namespace matterfit::diagnose {

struct Extension;
struct ExtendOptions;

/// What a law with free numbers (Effect::last) does of what is wrong.
struct FreeLaw {
  Candidate candidate;
  Score score;     ///< at the base, beside all candidates
  double p = 1.0;  ///< of so large a largest score where nothing is hidden
  /// By Extension::first's scores: the share of what each candidate's first estimate makes that the
  /// free law could make as well, 1 − T_free/T_frozen, as no prior holds it; 0 of what is not
  /// observable.
  std::vector<double> absorbed;
  /// Its numbers refitted beside the causes of the best extension, or beside none where that is
  /// not accepted; nothing where nothing was left to explain, or its score does not stand out.
  std::optional<Trial> trial;
  /// The trial leaves so much less of what was fitted to and of what was kept back than the model
  /// without it that it belongs into the extended model.
  bool improves = false;
};

/// Step 10, after acceptance: the law is scored frozen and free, and freed where something is left
/// that no named cause explains. Nothing where the model has no such effect, or it cannot be
/// differentiated. `trials` and `judge` are those of the search.
[[nodiscard]] std::optional<FreeLaw> free_law(const Study& study, const Trials& trials,
                                              const Judge& judge, const ExtendOptions& options,
                                              const Extension& found);

}  // namespace matterfit::diagnose
