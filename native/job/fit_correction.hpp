// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "fit/model/experiment.hpp"
#include "job/fit_further.hpp"

namespace matterfit::job {

/// Throws Error(kInput) where no sample is held out: nothing could then show whether a correction
/// predicts or only imitates.
void require_hold_out(const fit::Experiment& experiment);

/// Goes on (job/fit_further.hpp) with the numbers of a correction beside the law of each of the
/// bodies (material/correction.hpp), from what the document has or 0, each with the prior of its
/// row, and with its shear damping (fit::ParameterSpec::from_zero). First those that the captures
/// do not excite are left where they are (fit::LawFit::excited()). Taken, of all bodies, only where
/// what is held out is missed by less, by more than noise makes of it. The report has besides
/// `bodies`: by their names `freed`, the indices of those that were fitted, `damping_freed`, and
/// where it is taken `numbers`, `stress_share`, `damping_shear` and `sentence` (docs/formats.md);
/// those of the first, `from.body`, stand beside its name too. A correction that cannot be
/// simulated is not taken, and a statement says why.
[[nodiscard]] FurtherFit fit_correction(FurtherStart from, const std::vector<std::string>& bodies,
                                        const Interrupter& interrupter,
                                        std::vector<std::string>& statements,
                                        std::vector<Json>& history);

}  // namespace matterfit::job
