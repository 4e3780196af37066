// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/stages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace matterfit::fit {
namespace {

/// What the start takes of the whole, about.
constexpr double kStartShare = 0.15;
/// What a stage that is led by a coarser one takes of the time that it would take alone, about.
constexpr double kLedShare = 0.3;

}  // namespace

std::vector<SearchStage> stages_of(const std::vector<double>& levels,
                                   const std::vector<Window>& windows) {
  std::vector<SearchStage> stages;
  for (std::size_t l = 0; l < levels.size(); ++l) {
    for (std::size_t w = l == 0 ? 0 : windows.size() - 1; w < windows.size(); ++w) {
      SearchStage stage;
      stage.level = levels[l];
      if (l > 0) stage.stand_in = levels[l - 1];
      stage.window = windows[w];
      stage.whole = w + 1 == windows.size();
      stage.last = stage.whole && l + 1 == levels.size();
      stage.frames = "frames " + std::to_string(windows[w].first_frame) + "-" +
                     std::to_string(windows[w].last_frame);
      stage.name = stage.frames;
      if (levels[l] != 1.0) stage.name += fmt::format(", separation ×{:g}", levels[l]);
      stages.push_back(std::move(stage));
    }
  }
  return stages;
}

double fraction_done(const std::vector<SearchStage>& stages, const LawState& state, double part) {
  // The start takes as long as a stage or longer; iterations go quicker at a stage's end.
  double before = 0.0;
  double all = 0.0;
  for (std::size_t s = 0; s < stages.size(); ++s) {
    double weight = (stages[s].window.last_frame - stages[s].window.first_frame + 1) /
                    std::pow(stages[s].level, 2.0);
    if (stages[s].last) weight *= 2.0;
    if (stages[s].level < stages[state.first_stage].level) weight *= kLedShare;
    if (s < state.stage) before += weight;
    all += weight;
    if (s == state.stage && state.search) {
      const double done = state.search->iteration + part;
      before += weight * done / (done + 3.0);
    }
  }
  return state.begun() ? kStartShare + (1.0 - kStartShare) * std::clamp(before / all, 0.0, 1.0)
                       : kStartShare * state.evaluations / (state.evaluations + 10.0);
}

}  // namespace matterfit::fit
