// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fit/model/window.hpp"
#include "fit/search/law_state.hpp"

namespace matterfit::fit {

/// One part of a search: a window of the captures at a level.
struct SearchStage {
  std::string frames;  ///< "frames 1-13"
  std::string name;    ///< those, with the level where that is not 1
  double level = 1.0;
  std::optional<double> stand_in;  ///< the level that Jacobians come from at first
  Window window;
  bool whole = false;  ///< its window is the whole clip
  bool last = false;
};

/// The stages of a search: the windows one after the other at the first level, then the last of
/// them, the whole clip, at each of the others, led by the level before.
[[nodiscard]] std::vector<SearchStage> stages_of(const std::vector<double>& levels,
                                                 const std::vector<Window>& windows);

/// How much of a search is done, a guess in [0, 1]. `part`: of the present iteration.
[[nodiscard]] double fraction_done(const std::vector<SearchStage>& stages, const LawState& state,
                                   double part);

}  // namespace matterfit::fit
