// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "fit/search/law_state.hpp"

/// The order in which the candidate laws of a fit are fitted, and which of them are left early: all
/// of them come to a first standing, then the one that misses the capture least goes on (a window
/// that grows makes it miss more, so that another one may have its turn), and a law that misses the
/// capture by far more than another at the same standing is not followed further.
namespace matterfit::fit {

/// Adds to the standings of its present stage.
void add_standing(LawState& law, const Standing& standing);

/// The law that goes on: one without a standing, then the one that is nearest; the first of equals;
/// nothing if all are finished.
[[nodiscard]] std::optional<std::size_t> next_law(const std::vector<LawState>& laws);

struct LeftLaw {
  std::size_t law = 0;
  std::string reason;
};

/// The unfinished laws that miss the capture by far more than another one did at their newest
/// standing, and by more than noise and grid explain. Those that were spared are not among them.
[[nodiscard]] std::vector<LeftLaw> hopeless_laws(const std::vector<LawState>& laws);

/// Ends the search of an unfinished law early.
void leave(LawState& law, std::string reason);
/// Has a law that was left go on where it was, to its end.
void spare(LawState& law);

/// The law that came nearest, of those that were neither left nor failed: over the whole clip where
/// one has come so far. Nothing if none has a standing.
[[nodiscard]] std::optional<std::size_t> leading_law(const std::vector<LawState>& laws);

}  // namespace matterfit::fit
