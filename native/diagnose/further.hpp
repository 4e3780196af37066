// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "diagnose/extend.hpp"

namespace matterfit::diagnose {

/// Step 7's second half: with the best single cause in `out`, what is left beside it; further
/// causes as long as they are worth it, one at a time and as pairs, and elimination of those that
/// are no longer needed. Sets `best`, `last` and `looseness`. `trials` and `judge` are those that
/// the singles were tried with.
void add_further_causes(const Study& study, const Trials& trials, const Judge& judge,
                        const ExtendOptions& options, Extension& out);

}  // namespace matterfit::diagnose
