// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/search_phases.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <variant>

#include "base/error.hpp"
#include "fit/model/step_plan.hpp"
#include "fit/search/race.hpp"

namespace matterfit::fit {
namespace {

/// How often the last stage is repeated with the substeps that the solver takes at its end.
constexpr int kMostRepeats = 1;
/// Iterations from one comparison of candidate laws to the next.
constexpr int kIterationsToStanding = 5;

}  // namespace

void SearchPhases::advance(LawState& state, std::vector<SearchStep>& history) {
  if (state.finished()) return;
  if (state.values.empty()) {
    state.phase =
        Finished{true, "No parameter is of this law: it is taken as the document has it."};
  } else if (!state.begun()) {
    state = after_start(state);
  } else if (std::holds_alternative<FarOff>(state.phase)) {
    state = after_far_off(state);
  } else if (!state.search) {
    LawState next = state;
    begin_stage(next);
    state = std::move(next);
  } else {
    state = after_iteration(state, history);
  }
}

LawState SearchPhases::after_start(LawState state) {
  work_.find_start(state);
  state.phase = InStage{};
  state.candidates.push_back(state.values);
  return state;
}

LawState SearchPhases::after_far_off(LawState state) {
  state.phase = InStage{};
  if (work_.skip_level(state)) {
    state.candidates.push_back(state.values);
    state.search.reset();
    return state;
  }
  state.rescanned = true;
  if (work_.rescan(state)) {
    state.search.reset();
  } else {
    end_stage(state);
  }
  return state;
}

void SearchPhases::begin_stage(LawState& state) {
  const auto failure = work_.begin_stage(state);
  if (!failure) return;
  const std::string why = "The simulation could not be completed: " + failure->message;
  if (state.iterations == 0) {
    if (failure->by_input) throw_input(failure->message);
    throw_compute("the fit cannot begin at these values. " + why);
  }
  if (back_to_first_start(state)) return;
  state.phase =
      Finished{false, "Stopped before the stage " + stages_[state.stage].name + ". " + why};
}

LawState SearchPhases::after_iteration(const LawState& state, std::vector<SearchStep>& history) {
  std::string failure;
  auto next = work_.iterated(state, history, failure);
  if (next) {
    take_standing(*next, state.search->iteration);
    if (next->search->finished) end_stage(*next);
    return std::move(*next);
  }
  if (state.iterations == 0) throw_compute("fit: " + failure);
  LawState ended = state;
  if (!back_to_first_start(ended)) {
    ended.phase =
        Finished{false, "Stopped in the stage " + stages_[state.stage].name + ": " + failure};
  }
  return ended;
}

void SearchPhases::end_stage(LawState& state) {
  // Where the first motion or the class was not known only the whole clip tells a wrong valley.
  const bool one = !state.torn && std::holds_alternative<std::monostate>(state.second);
  const bool judged = one || (stages_[state.stage].whole && at_first_level(state));
  if (judged && try_other_start(state)) return;
  if (judged && may_rescan(state) && work_.is_far(state)) {
    state.phase = FarOff{};
    return;
  }
  if (!stages_[state.stage].last) {
    ++state.stage;
    state.search.reset();
    return;
  }
  // Substeps are to be those that the solver takes at the end.
  const bool other_steps =
      std::any_of(state.refinements.begin(), state.refinements.end(),
                  [](int power) { return power != 0 && power != StepPlan::kUnsettled; });
  if (other_steps && state.repeats < kMostRepeats) {
    ++state.repeats;
    state.search.reset();
    return;
  }
  state.phase = Finished{state.search->converged, state.search->reason};
}

bool SearchPhases::try_other_start(LawState& state) {
  if (std::holds_alternative<std::monostate>(state.second)) return false;
  const double mean = work_.mean_missed(state);
  if (auto* other = std::get_if<OtherStart>(&state.second)) {
    if (mean <= work_.far()) {
      state.second = std::monostate{};
      return false;
    }
    FirstEnd first{std::exchange(state.values, std::move(other->values)), mean};
    state.second = std::move(first);
    state.stage = state.first_stage;
    state.search.reset();
    return true;
  }
  const double first_mean = std::get<FirstEnd>(state.second).mean;
  const bool nearer = mean <= first_mean;
  state.statements.push_back(fmt::format(
      "That search ended {:.3g} mm off on the mean, and one that began with the other "
      "{} {:.3g} mm: the {} is taken.",
      1e3 * first_mean, state.torn ? "motion" : "class", 1e3 * mean, nearer ? "second" : "first"));
  if (!nearer) return back_to_first_start(state);
  state.second = std::monostate{};
  return false;
}

bool SearchPhases::back_to_first_start(LawState& state) const {
  auto* first = std::get_if<FirstEnd>(&state.second);
  if (first == nullptr) return false;
  state.values = std::move(first->values);
  state.second = std::monostate{};
  while (!stages_[state.stage].whole) ++state.stage;
  state.search.reset();
  return true;
}

bool SearchPhases::at_first_level(const LawState& state) const {
  return stages_[state.stage].level == stages_[state.first_stage].level;
}

bool SearchPhases::may_rescan(const LawState& state) const {
  if (state.rescanned) return false;
  return state.torn ? at_first_level(state) : state.stage == state.first_stage;
}

void SearchPhases::take_standing(LawState& state, int iterations_before) {
  const LeastSquaresState& search = *state.search;
  const bool due = search.finished || search.iteration / kIterationsToStanding >
                                          iterations_before / kIterationsToStanding;
  if (!due || search.residual.size() == 0) return;
  const bool far = work_.is_far(state);
  const SearchStage& stage = stages_[state.stage];
  const bool early = far && may_rescan(state);
  const bool by_grid = early && stage.level != stages_.back().level;
  add_standing(state, {work_.rms_missed(state), stage.whole && !early, far, by_grid});
}

}  // namespace matterfit::fit
