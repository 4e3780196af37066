// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fit/search/law_state.hpp"
#include "fit/search/search_progress.hpp"
#include "fit/search/stages.hpp"

namespace matterfit::fit {

/// What SearchPhases asks of the simulations and captures of one law. LawFit answers with them;
/// search_phases_test.cpp with numbers alone.
class SearchWork {
 public:
  SearchWork() = default;
  virtual ~SearchWork() = default;
  SearchWork(const SearchWork&) = delete;
  SearchWork& operator=(const SearchWork&) = delete;

  /// Sets `values`, `second`, `torn` and, where the first level does not show the motion, the first
  /// stage.
  virtual void find_start(LawState& state) = 0;
  /// Moves on to a finer level where the present one does not show the motion; false if it does.
  [[nodiscard]] virtual bool skip_level(LawState& state) = 0;
  /// Scans once more from `values`; true if something better was found.
  [[nodiscard]] virtual bool rescan(LawState& state) = 0;
  /// Sets what belongs to the state's stage: its substeps and `search`. Returns why the stage
  /// cannot be simulated at `values`; nothing if it can.
  [[nodiscard]] virtual std::optional<Failure> begin_stage(LawState& state) = 0;
  /// The state one iteration of `search` later, whose steps are added to `history`; nothing where
  /// the simulation could not be completed (`failure`).
  [[nodiscard]] virtual std::optional<LawState> iterated(const LawState& state,
                                                         std::vector<SearchStep>& history,
                                                         std::string& failure) = 0;
  /// The mean distance [m] of what the stage compares, infinite where it has compared nothing yet;
  /// its root mean square [m]; and whether that is more than noise and grid explain.
  [[nodiscard]] virtual double mean_missed(const LawState& state) = 0;
  [[nodiscard]] virtual double rms_missed(const LawState& state) = 0;
  [[nodiscard]] virtual bool is_far(const LawState& state) = 0;
  /// The mean distance [m] beyond which the end of a stage is far off.
  [[nodiscard]] virtual double far() = 0;
};

/// The order of a search, without any simulation of its own: the start, the stages, what follows a
/// stage that ended far off, a second start, and the end.
///
///     NotBegun ──start──▶ InStage ──far off──▶ FarOff
///                          │  ▲ ▲───finer level, or scanned again──┘
///                          │  └─ the next stage, the last one again with other substeps, another
///                          ▼     start
///                        Finished
class SearchPhases {
 public:
  /// Both are borrowed.
  SearchPhases(const std::vector<SearchStage>& stages, SearchWork& work)
      : stages_(stages), work_(work) {}

  /// One step: the start, the beginning of a stage, an iteration, or what follows a stage that
  /// ended far off. Adds lines to `history`. Throws Error(kCompute) if the simulation at the start
  /// cannot be completed, Error(kInput) if the document is why, and what the work throws; the state
  /// is then as before. Where a later simulation cannot be completed the search ends with the
  /// values so far.
  void advance(LawState& state, std::vector<SearchStep>& history);
  /// Begins the state's stage; without `search` after it the state is finished, or back at the
  /// first of two starts.
  void begin_stage(LawState& state);

 private:
  [[nodiscard]] LawState after_start(LawState state);
  [[nodiscard]] LawState after_far_off(LawState state);
  [[nodiscard]] LawState after_iteration(const LawState& state, std::vector<SearchStep>& history);
  void end_stage(LawState& state);
  /// At the end of the first level's last stage, far off, with two starts: goes to the second, and
  /// after that back to the first if the second ended farther off. True where a stage begins anew.
  [[nodiscard]] bool try_other_start(LawState& state);
  /// To where the first of two starts ended, at the end of its last stage; false if it was no
  /// second that was searched from.
  [[nodiscard]] bool back_to_first_start(LawState& state) const;
  [[nodiscard]] bool at_first_level(const LawState& state) const;
  /// Whether the present stage is one after which another scan may be due.
  [[nodiscard]] bool may_rescan(const LawState& state) const;
  /// Every few iterations notes how far the capture is missed.
  void take_standing(LawState& state, int iterations_before);

  const std::vector<SearchStage>& stages_;
  SearchWork& work_;
};

}  // namespace matterfit::fit
