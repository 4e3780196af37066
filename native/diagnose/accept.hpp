// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "diagnose/extend.hpp"
#include "diagnose/judge.hpp"

namespace matterfit::diagnose {

/// Whether a model with `numbers` more numbers predicts what was kept back better than the one
/// without them: its gain over that is surely above 0 and beats the naive baselines; below the
/// floor, where distances say nothing, by the likelihood of what was kept back; and where nothing
/// was, it only may not be worse.
[[nodiscard]] bool predicts(const Gain& gain, const Judge::Opinion& without,
                            const Judge::Opinion& with, int numbers);

/// Step 8: the gains on what was kept back, whether the best extension in `out` is accepted or is
/// within what the solver's error may be off by, and the rivals that the best single cause does not
/// exclude. Sets `accepted`, `within_solver`, `rivals` and every trial's gain. `refitter` and
/// `judge` are those that the trials were made with.
void accept(const Study& study, const Refitter& refitter, const Judge& judge,
            const ExtendOptions& options, Extension& out);

}  // namespace matterfit::diagnose
