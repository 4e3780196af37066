// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/start_search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <variant>

#include "fit/search/start.hpp"

namespace matterfit::fit {
namespace {

constexpr std::size_t kScanSamples = 32;
/// Where the first motion is not known.
constexpr std::size_t kFirstSamples = 6;
/// Steps of the scan after the first stage, either way: where the law is wrong all of them are
/// poor.
constexpr int kNear = 3;
/// A level does not show the motion where a finer one differs by more of what is missed.
constexpr double kLevelGap = 0.7;
/// A start of the momentum balance that misses by so many times what is poor is of the right class:
/// looking for the classes by simulations would take dozens of runs.
constexpr double kNearClass = 8.0;

}  // namespace

StartSearch::StartSearch(SearchProblems& problems, const std::vector<SearchStage>& stages,
                         const Interrupter& interrupter, Tell tell)
    : problems_(problems), stages_(stages), interrupter_(interrupter), tell_(std::move(tell)) {}

std::vector<double> StartSearch::mean_distances(LawState& state,
                                                const std::vector<std::vector<double>>& points,
                                                const Window& window, double level) {
  const CaptureProblem at_level = problems_.problem(level, window);
  const auto progress = [&](double part) { tell_(state, "looking for a start", part, told_); };
  progress(0.0);
  std::vector<double> means;
  const Evaluation found = problems_.model(level).evaluate(points, {window.until}, progress);
  for (const auto& outcome : found.outcomes) {
    const double mean = outcome ? mean_value(at_level.distances(at_level.residuals(*outcome)))
                                : std::numeric_limits<double>::infinity();
    means.push_back(std::isfinite(mean) ? mean : std::numeric_limits<double>::infinity());
  }
  state.evaluations += static_cast<int>(points.size());
  told_ = *std::min_element(means.begin(), means.end());
  return means;
}

std::vector<double> StartSearch::mean_distances(LawState& state,
                                                const std::vector<std::vector<double>>& points,
                                                const Window& window) {
  return mean_distances(state, points, window, stages_[state.first_stage].level);
}

std::vector<double> StartSearch::start_distances(LawState& state, const StartLimit& limit,
                                                 const std::vector<std::vector<double>>& points,
                                                 const Window& window) {
  std::vector<double> all(points.size(), std::numeric_limits<double>::infinity());
  std::vector<std::vector<double>> tried;
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!limit.allows(points[i])) continue;
    tried.push_back(points[i]);
    places.push_back(i);
  }
  if (tried.empty()) return all;
  const std::vector<double> found = mean_distances(state, tried, window);
  for (std::size_t i = 0; i < places.size(); ++i) all[places[i]] = found[i];
  return all;
}

void StartSearch::choose_material(LawState& state) {
  const SearchStage& stage = stages_[state.stage];
  const bool finer = state.stage > 0 && stages_[state.stage - 1].level != stage.level;
  // A second start is searched from where it is.
  const bool second =
      state.stage == state.first_stage && std::holds_alternative<FirstEnd>(state.second);
  if (!finer || second || state.repeats > 0) return;
  std::vector<std::vector<double>> points{state.values};
  for (const std::vector<double>& candidate : state.candidates) {
    std::vector<double> point = with_law_of(state.values, candidate);
    if (std::find(points.begin(), points.end(), point) == points.end()) {
      points.push_back(std::move(point));
    }
  }
  if (points.size() == 1) return;
  const auto means = mean_distances(state, points, stage.window, stage.level);
  const auto best = std::min_element(means.begin(), means.end());
  state.values = points[static_cast<std::size_t>(best - means.begin())];
}

void StartSearch::begin(LawState& state) {
  const auto& runs = problems_.runs();
  const MotionStart motion =
      with_initial_motion(runs, problems_.scenes(), problems_.parameters(), state.values);
  Start best;
  best.values = state.values;
  if (motion.flights != state.values) {
    const auto means =
        mean_distances(state, {state.values, motion.flights}, stages_.front().window);
    if (means[1] < means[0] || !std::isfinite(means[0])) best.values = motion.flights;
  }
  state.torn = !motion.contradicted.empty();
  // What a motion that is not quite right leads to later is no judge of a material.
  const Window window = first_window(runs, state.torn ? kFirstSamples : kScanSamples);
  best.mean = mean_distances(state, {best.values}, window).front();
  if (best.mean > problems_.poor()) {
    const StartLimit limit(runs, problems_.scenes(), problems_.parameters());
    EquationStart balance;
    if (problems_.setup().options.loss == Loss::kTracks) {
      const std::vector<FlowStart> classes =
          flow_starts(problems_.parameters(), problems_.scenes(), best.values);
      balance = classes.empty()
                    ? equation_start(runs, problems_.scenes(), problems_.parameters(), best.values,
                                     problems_.setup().threads, interrupter_)
                    : rank_classes(runs, problems_.scenes(), problems_.parameters(), classes,
                                   problems_.setup().threads, interrupter_);
      bool softer = false;
      for (std::vector<double>& values : balance.candidates) {
        std::vector<double> softened = limit.softened(values);
        softer = softer || softened != values;
        values = std::move(softened);
      }
      if (softer) balance.statement += "; made softer, so that a run takes minutes at most";
      state.candidates = balance.candidates;
      state.candidates.push_back(problems_.parameters().starts());
    }
    find_material(state, window, limit, balance, best);
    if (state.torn) {
      Start other;
      other.values = motion.guesses;
      other.mean = mean_distances(state, {other.values}, window).front();
      find_material(state, window, limit, balance, other);
      const bool better = other.mean < best.mean;
      state.statements.push_back(fmt::format(
          "captures {}: the first frames are no rigid flight; the body may touch something before "
          "the second. {}",
          fmt::join(motion.contradicted, ", "),
          better ? "The motion from the first frame to the second led nearer to the capture than "
                   "the document's, and the search begins with it."
          : std::isfinite(best.mean)
              ? "The document's motion led nearer to the capture than that from the first frame to "
                "the second, and the search begins with it."
              : "With neither the document's motion nor that from the first frame to the second "
                "could anything be simulated."));
      if (better) std::swap(best, other);
      if (std::isfinite(other.mean)) state.second = OtherStart{std::move(other.values)};
    }
    if (!best.statement.empty()) state.statements.push_back(std::move(best.statement));
  }
  state.values = std::move(best.values);
  while (best.scanned && skip_level(state)) {
  }
}

void StartSearch::find_material(LawState& state, const Window& window, const StartLimit& limit,
                                const EquationStart& balance, Start& start) {
  start.statement = balance.statement;
  if (!balance.candidates.empty()) {
    std::vector<std::vector<double>> points;
    for (const std::vector<double>& values : balance.candidates) {
      points.push_back(with_law_of(start.values, values));
    }
    const auto means = mean_distances(state, points, window);
    const auto best = std::min_element(means.begin(), means.end());
    const bool better = *best < start.mean;
    const auto millimetres = [](double distance) {
      return std::isfinite(distance) ? fmt::format("{:.3g} mm", 1e3 * distance)
                                     : std::string("beyond all");
    };
    start.statement += fmt::format(
        ". Over the first {} samples it misses the capture by {}, what it replaces by {}; it is "
        "{}taken.",
        state.torn ? kFirstSamples : kScanSamples, millimetres(*best), millimetres(start.mean),
        better ? "" : "not ");
    if (better) {
      start.values = points[static_cast<std::size_t>(best - means.begin())];
      start.mean = *best;
    }
  }
  if (start.mean <= problems_.poor()) return;
  const auto costs = [&](const auto& points) {
    return start_distances(state, limit, points, window);
  };
  constexpr int kFar = 8;
  const bool finely = problems_.setup().options.loss != Loss::kTracks;
  const auto flows = flow_starts(problems_.parameters(), problems_.scenes(), start.values);
  if (!flows.empty() && start.mean <= kNearClass * problems_.poor() &&
      !balance.candidates.empty()) {
    start.statement += " That is near enough: the classes are not looked for one by one.";
    return;
  }
  if (!flows.empty()) {
    take_flow(state, search_flows(problems_.parameters(), flows, costs, finely), start);
    return;
  }
  Scanned found = scanned(problems_.parameters(), start.values, start.mean, costs, kFar, finely);
  start.values = std::move(found.values);
  start.mean = found.cost;
  start.scanned = true;
}

void StartSearch::take_flow(LawState& state, std::vector<FlowFound> found, Start& start) const {
  start.statement += (start.statement.empty() ? "" : " ") + flow_statement(found);
  if (found.front().at.cost < start.mean) {
    start.values = std::move(found.front().at.values);
    start.mean = found.front().at.cost;
  }
  start.scanned = true;
  // A class that is nearly as near may be the right one.
  constexpr double kNearlyAsNear = 1.5;
  if (found.size() > 1 && !state.torn && found[1].at.cost < kNearlyAsNear * start.mean) {
    state.second = OtherStart{std::move(found[1].at.values)};
  }
}

std::vector<double> StartSearch::with_law_of(std::vector<double> values,
                                             const std::vector<double>& material) const {
  const Quantity& latent = row_named(Owner::kBody, "material.latent[#]");
  for (std::size_t k = 0; k < values.size(); ++k) {
    const Quantity* row = problems_.parameters().path(k).quantity;
    if (row->of_law || row == &latent) values[k] = material[k];
  }
  return values;
}

bool StartSearch::skip_level(LawState& state) {
  const double level = stages_[state.first_stage].level;
  const auto next = std::find_if(stages_.begin(), stages_.end(),
                                 [&](const SearchStage& stage) { return stage.level < level; });
  const bool free =
      problems_.setup().options.levels.empty() && problems_.setup().options.loss == Loss::kTracks;
  if (next == stages_.end() || !free) return false;
  const Window window = first_window(problems_.runs(), kScanSamples);
  const auto residuals = [&](double at) -> std::optional<Eigen::VectorXd> {
    ++state.evaluations;
    const std::vector<std::vector<double>> here{state.values};
    const auto outcome = problems_.model(at).evaluate(here, {window.until}).outcomes.front();
    if (!outcome) return std::nullopt;
    return problems_.problem(at, window).residuals(*outcome);
  };
  const auto coarse = residuals(level);
  if (!coarse) return false;
  const CaptureProblem at_level = problems_.problem(level, window);
  const double missed = mean_value(at_level.distances(*coarse));
  if (missed <= problems_.far()) return false;
  const auto fine = residuals(next->level);
  if (!fine || mean_value(at_level.distances(*fine - *coarse)) <= kLevelGap * missed) return false;
  state.first_stage = static_cast<std::size_t>(next - stages_.begin());
  state.stage = state.first_stage;
  return true;
}

bool StartSearch::rescan(LawState& state) {
  const Window window = first_window(problems_.runs(), kScanSamples);
  const double mean = mean_distances(state, {state.values}, window).front();
  const StartLimit limit(problems_.runs(), problems_.scenes(), problems_.parameters());
  const auto costs = [&](const auto& points) {
    return start_distances(state, limit, points, window);
  };
  std::vector<double> found = scanned(problems_.parameters(), state.values, mean, costs, kNear,
                                      problems_.setup().options.loss != Loss::kTracks)
                                  .values;
  if (found == state.values) return false;
  state.values = std::move(found);
  state.candidates.push_back(state.values);
  return true;
}

}  // namespace matterfit::fit
