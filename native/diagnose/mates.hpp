// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "diagnose/refit.hpp"
#include "diagnose/scores.hpp"
#include "diagnose/study.hpp"
#include "diagnose/whitening.hpp"

namespace matterfit::diagnose {

/// Candidates that the catalogue says `cause` is confused with, in their best shapes and where they
/// are observable, without those of `known` effects and those with less than `share` of its score.
[[nodiscard]] std::vector<Candidate> mates_of(const Model& model, const std::vector<Score>& scores,
                                              const Candidate& cause, const std::vector<int>& known,
                                              double share = 0.0);

/// Starts of refits with each of the candidates in place of a refit's causes. Far from a
/// motion slopes say little of what a cause would do to it: an oscillation that should die away and
/// has another frequency meanwhile. So they are taken at the refit's own parameters, and each
/// candidate has the numbers that by them come nearest to what the refit's causes change, and twice
/// and half of those. Without those that cannot be simulated there; nothing where not even the
/// motion without causes can. Throws Error(kCancelled).
[[nodiscard]] std::vector<std::pair<Candidate, RefitStart>> starts_beside(
    const Study& study, const Whitening& whitening, const Refit& good,
    const std::vector<Candidate>& candidates, DifferenceOptions options);

}  // namespace matterfit::diagnose
