// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fit/search/law_fit.hpp"
#include "job/documents/json_reader.hpp"

namespace matterfit::job {

/// Where a fit goes on that has ended.
struct FurtherStart {
  fit::SearchSetup setup;  ///< of the fit before
  fit::LawState before;
  std::string body;    ///< whose material gets further numbers
  int iterations = 0;  ///< accepted steps at most
  std::function<void(const fit::SearchProgress&)> tell;
};

/// A fit that went on with further numbers beside its own.
// NOLINTNEXTLINE(bugprone-exception-escape): of the JSON library's moves it cannot tell
struct FurtherFit {
  std::unique_ptr<fit::LawFit> fit;  ///< of the parameters before and of the further ones
  fit::LawState state;               ///< the best of its iterations
  bool taken = false;                ///< it is nearer than the fit before
  std::string key;                   ///< `report`'s in the result's `fit`, and that of the document
  /// `body`, `taken`, `iterations`, `evaluations`, `held_out_mm` and `fitted_mm` with `without` and
  /// `with` each, null where not known.
  Json report;
};

/// Mean errors [mm] of what is held out and of what is fitted, as a simulation outside of the fit
/// has them; nothing where they are not known.
struct FurtherMeans {
  std::optional<double> held;
  std::optional<double> seen;
};

/// Whether `now` is nearer than `best`, by what is held out where `best` has that. Both are of
/// states that can be simulated, or `now` has nothing.
[[nodiscard]] bool is_nearer(const FurtherMeans& now, const FurtherMeans& best);

/// The mean errors of a fit at a state's values.
[[nodiscard]] FurtherMeans means_of(fit::LawFit& fit, const fit::LawState& state);

/// FurtherFit::report.
[[nodiscard]] Json further_report(const std::string& body, bool taken, int iterations,
                                  int evaluations, const FurtherMeans& without,
                                  const FurtherMeans& with);

/// From where a fit ended, with the parameters `more` after its own: Levenberg–Marquardt as in the
/// last stage of any fit. The best iterate is the one with the least mean error on what is held
/// out; without a hold-out the last; none where the fit before cannot be simulated. `taken` only
/// where that is less than the fit before has, by more than `least_gain` of it: what is held out
/// then chooses, and its error is no longer that of something unseen. A step whose simulation
/// cannot be completed is refused. Throws as fit::LawFit does.
[[nodiscard]] FurtherFit go_on(FurtherStart from, std::vector<fit::ParameterSpec> more,
                               double least_gain, const Interrupter& interrupter,
                               std::vector<std::string>& statements, std::vector<Json>& history);

}  // namespace matterfit::job
