// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "fit/model/model.hpp"
#include "fit/numerics/least_squares.hpp"
#include "fit/search/nearest.hpp"

namespace matterfit::fit {

/// How far a law missed what its stage looks at, some iterations into it.
struct Standing {
  double rms = 0.0;    ///< [m]
  bool firm = false;   ///< over the whole clip, and not in a valley that another scan may leave
  bool far = false;    ///< by more than noise and grid explain
  bool early = false;  ///< far, and a coarser grid than the last stage's may be why
};

/// The start is still to be looked for.
struct NotBegun {};
/// A stage is searched; it is still to be begun where LawState::search is empty.
struct InStage {};
/// A stage ended far off: a finer level or another scan comes next. LawState::search keeps what the
/// stage found.
struct FarOff {};
/// No step is left.
struct Finished {
  bool converged = false;
  std::string reason;
};
/// Finished early, because another law came much nearer. `then`: where it would go on.
struct LeftEarly {
  std::string reason;
  std::variant<InStage, FarOff> then;
};
/// What comes next in the search of a law. SearchPhases (search_phases.hpp) goes from one to the
/// next; leave() and spare() (race.hpp) to and from LeftEarly.
using SearchPhase = std::variant<NotBegun, InStage, FarOff, Finished, LeftEarly>;

/// A second start, the one that seemed worse. It is tried where the first level ends far off.
struct OtherStart {
  std::vector<double> values;
};
/// The second start is searched from; this is where the search from the first one ended.
struct FirstEnd {
  std::vector<double> values;
  double mean = 0.0;  ///< distance from the capture [m]
};
using SecondStart = std::variant<std::monostate, OtherStart, FirstEnd>;

/// Where the fit of one law stands.
struct LawState {
  std::string law;
  std::vector<double> values;  ///< physical, the best so far
  SearchPhase phase;
  SecondStart second;
  std::vector<std::vector<double>> candidates;  ///< for a start, the one that was taken last
  bool torn = false;       ///< the first frames are no flight: the start is that of a few of them
  bool rescanned = false;  ///< the scan after a FarOff stage has been made: there is no other one
  bool spared = false;     ///< was LeftEarly, and then predicted best: is not left again
  std::size_t stage = 0;
  std::size_t first_stage = 0;           ///< later where a level does not show the motion
  int repeats = 0;                       ///< of the last stage, with substeps chosen anew
  std::vector<double> stage_start;       ///< the values where the stage began
  std::vector<RunSteps> steps;           ///< of the present stage
  std::vector<RunSteps> stand_in_steps;  ///< of the coarser level that leads it; empty: none
  std::vector<int> refinements;          ///< of `steps`, that the residuals were computed with
  std::optional<Nearest> nearest;        ///< of the present stage
  std::vector<std::vector<Standing>> standings;  ///< by stage; candidates are compared by them
  std::optional<LeastSquaresState> search;       ///< of the present stage
  std::string failed;  ///< why this law could not be fitted, or its end not simulated; else empty
  int iterations = 0;  ///< of all stages
  int evaluations = 0;
  std::vector<std::string> statements;  ///< how its start was found

  [[nodiscard]] bool begun() const { return !std::holds_alternative<NotBegun>(phase); }
  /// No step follows: Finished, or LeftEarly.
  [[nodiscard]] bool finished() const { return std::holds_alternative<Finished>(phase) || left(); }
  [[nodiscard]] bool left() const { return std::holds_alternative<LeftEarly>(phase); }
  [[nodiscard]] bool converged() const;
  /// Why it is finished, a sentence; empty before that.
  [[nodiscard]] std::string reason() const;
};

}  // namespace matterfit::fit
