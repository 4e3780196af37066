// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "diagnose/judge.hpp"
#include "diagnose/scores.hpp"
#include "diagnose/trials.hpp"

namespace matterfit::diagnose {

struct Extension;
struct ExtendOptions;

/// A law with free numbers (Effect::last) beside a model.
struct LawTrial {
  /// How it ended.
  enum class End : std::uint8_t {
    kImproves,   ///< explains and predicts what the model without it does not
    kUnlikely,   ///< explains no more than its numbers would by chance
    kAtBound,    ///< a number of it ran to its bound
    kNoTest,     ///< nothing was kept back that could test it
    kNoForecast  ///< what was kept back is not better with it
  };
  Trial trial;             ///< its gain is over the model without it
  double explained = 0.0;  ///< share of what that model leaves beyond noise
  End end = End::kUnlikely;
};

/// A free law beside a diagnosed model: its score, and what it explains.
struct FreeLaw {
  Candidate candidate;
  Score score;     ///< at the base, beside all candidates
  double p = 1.0;  ///< of so large a largest score where nothing is hidden
  /// By Extension::first's scores: the share of what each candidate's first estimate makes that the
  /// free law could make as well, 1 − T_free/T_frozen, an upper limit as its bounds are not looked
  /// at; 0 of what is not observable.
  std::vector<double> absorbed;
  /// Beside the causes of the best extension, where that is accepted and leaves something.
  std::optional<LawTrial> beside;
  /// Beside nothing, where no extension is accepted and its score stands out.
  std::optional<LawTrial> alone;
};

/// Step 10, after acceptance: the law is scored frozen and free, and freed where something is left
/// that no named cause explains. Nothing where the model has no such effect, or it cannot be
/// differentiated. `trials` and `judge` are those of the search.
[[nodiscard]] std::optional<FreeLaw> free_law(const Study& study, const Trials& trials,
                                              const Judge& judge, const ExtendOptions& options,
                                              const Extension& found);

}  // namespace matterfit::diagnose
