// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "fit/model/model.hpp"
#include "fit/numerics/least_squares.hpp"

namespace matterfit::fit {

/// How far a law missed what its stage looks at, some iterations into it.
struct Standing {
  double rms = 0.0;   ///< [m]
  bool firm = false;  ///< over the whole clip, and not in a valley that another scan may leave
  bool far = false;   ///< by more than noise and grid explain
};

/// Where the fit of one law stands.
struct LawState {
  std::string law;
  std::vector<double> values;                   ///< physical, the best so far
  bool begun = false;                           ///< the start has been looked for
  std::vector<std::vector<double>> candidates;  ///< for a start, the one that was taken last
  /// With `torn`, or of another class of flow: the start that seemed worse, tried if the other's
  /// level ends far off; and where that ended, until the second has.
  std::vector<double> other;
  std::vector<double> ended;
  double ended_mean = 0.0;  ///< [m]
  bool torn = false;        ///< the first frames are no flight: the start is that of a few of them
  bool scan_due = false;    ///< the first stage ended far off; what it found is kept
  bool rescanned = false;   ///< the scan that follows has been made
  std::size_t stage = 0;
  std::size_t first_stage = 0;           ///< later where a level does not show the motion
  int repeats = 0;                       ///< of the last stage, with substeps chosen anew
  std::vector<double> stage_start;       ///< the values where the stage began
  std::vector<RunSteps> steps;           ///< of the present stage
  std::vector<RunSteps> stand_in_steps;  ///< of the coarser level that leads it; empty: none
  std::vector<int> refinements;          ///< of `steps`, that the residuals were computed with
  std::vector<std::vector<Standing>> standings;  ///< by stage; candidates are compared by them
  std::optional<LeastSquaresState> search;
  bool finished = false;
  bool converged = false;
  std::string reason;
  std::string failed;   ///< why this law could not be fitted; else empty
  bool left = false;    ///< finished early, as another law came much nearer
  bool spared = false;  ///< was left, and then predicted best: goes on to its end
  int iterations = 0;   ///< of all stages
  int evaluations = 0;
  std::vector<std::string> statements;  ///< how its start was found
};

}  // namespace matterfit::fit
