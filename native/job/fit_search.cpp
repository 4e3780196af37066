// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "base/error.hpp"
#include "fit/data/metrics.hpp"
#include "fit/numerics/excited.hpp"
#include "job/fit_equation_start.hpp"
#include "job/fit_levels.hpp"
#include "job/fit_race.hpp"
#include "job/fit_start.hpp"

namespace matterfit::job {
namespace {

constexpr std::size_t kScanSamples = 32;
/// Where the first motion is not known.
constexpr std::size_t kFirstSamples = 6;
/// A start is poor where it misses the capture by so many times the noise, and by this part of the
/// body's size.
constexpr double kPoorNoise = 2.5;
constexpr double kPoorSize = 0.005;
/// Clouds: so many times what two samplings of one body miss each other by. That is a mean over
/// many, and well known; smoothing hides much of how far the bodies are off. A body's own surface
/// is that of its particles, which a smooth one misses by some more.
constexpr double kPoorCloud = 1.05;
constexpr double kFarCloud = 1.1;
constexpr double kFarSurface = 1.3;
/// Steps of the scan after the first stage, either way: where the law is wrong all of them are
/// poor.
constexpr int kNear = 3;
/// Stages before the last: how far is far enough.
constexpr int kShortStage = 8;
constexpr double kCoarseStep = 2e-2;
constexpr double kCoarseCost = 1e-3;
/// Until the last stage what a short clip hardly shows stays near where it was: the standard
/// deviation of that, in scales of the parameters.
constexpr double kLeash = 2.0;
/// Of the last stage, with the substeps that the solver takes at its end.
constexpr int kMostRepeats = 1;
/// A level does not show the motion where a finer one differs by more of what is missed.
constexpr double kLevelGap = 0.7;
/// Iterations from one comparison of candidate laws to the next.
constexpr int kIterationsToStanding = 5;
/// The grid that tells how much the values depend on it, and what it has of the difference itself:
/// errors of second order in the separation (docs/validation.md).
constexpr double kCoarser = 2.0;
constexpr double kOfCoarser = 1.0 / (kCoarser * kCoarser - 1.0);
/// What the start takes of the whole, about.
constexpr double kStartShare = 0.15;
/// What a stage that is led by a coarser one takes of the time that it would take alone, about.
constexpr double kLedShare = 0.3;

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? 0.0 : sum / double(values.size());
}

/// Of a capture of which the fit sees nothing.
bool is_unseen(const fit::Address& path, const std::vector<fit::Run>& runs) {
  const bool own = path.quantity->owner == fit::Owner::kCapture;
  const std::string& name = own ? path.owner : path.capture;
  if (name.empty()) return false;
  for (const fit::Run& run : runs) {
    for (const fit::Capture& capture : run.captures) {
      if (capture.input.name == name) return capture.used_count == 0;
    }
  }
  return false;
}

/// Has a problem tell its progress for as long as this stands.
class Told {
 public:
  Told(fit::CaptureProblem& problem, std::function<void(double)> tell) : problem_(problem) {
    tell(0.0);
    problem_.progress = std::move(tell);
  }
  ~Told() { problem_.progress = {}; }
  Told(const Told&) = delete;
  Told& operator=(const Told&) = delete;

 private:
  fit::CaptureProblem& problem_;
};

}  // namespace

std::string fit_label(const FitReport& report, const std::string& law) {
  constexpr std::size_t kMost = 63;
  const std::string iteration =
      report.iteration > 0 ? ", iteration " + std::to_string(report.iteration) : "";
  const std::string rms =
      std::isfinite(report.rms) ? fmt::format(", rms {:.2f} mm", 1e3 * report.rms) : "";
  std::string stage = report.stage;
  const std::string separation = ", separation ×";
  if (const std::size_t at = stage.find(separation); at != std::string::npos) {
    stage.replace(at, separation.size(), " ×");
  }
  const std::string name = law.empty() ? "" : law + ", ";
  std::string label = "Fitting: " + name + stage + iteration + rms;
  if (label.size() > kMost) label = "Fitting: " + name + stage + rms;
  if (label.size() > kMost) label = "Fitting: " + stage + rms;
  return label;
}

struct LawFit::Context {
  std::size_t stage;
  int repeats;
  fit::CaptureProblem problem;
  fit::LeastSquares search;
  std::optional<fit::CaptureProblem> stand_in;
};

LawFit::LawFit(FitSetup setup, const Interrupter& interrupter, std::vector<std::string>& statements)
    : setup_(std::move(setup)),
      interrupter_(interrupter),
      statements_(statements),
      predictor_(*setup_.experiment, setup_.parameters,
                 {setup_.fit->loss, setup_.target, setup_.threads, setup_.memory_limit_gb},
                 interrupter, setup_.builders) {
  std::vector<double> levels = setup_.fit->levels;
  if (levels.empty()) levels = usual_levels(scenes());
  const std::vector<fit::Window> windows = fit::growing_windows(runs(), setup_.fit->windows);
  for (std::size_t l = 0; l < levels.size(); ++l) {
    for (std::size_t w = l == 0 ? 0 : windows.size() - 1; w < windows.size(); ++w) {
      Stage stage;
      stage.level = levels[l];
      if (l > 0) stage.stand_in = levels[l - 1];
      stage.window = windows[w];
      stage.whole = w + 1 == windows.size();
      stage.last = stage.whole && l + 1 == levels.size();
      stage.name = "frames " + std::to_string(windows[w].first_frame) + "-" +
                   std::to_string(windows[w].last_frame);
      if (levels[l] != 1.0) stage.name += fmt::format(", separation ×{:g}", levels[l]);
      stages_.push_back(std::move(stage));
    }
  }
}

LawFit::~LawFit() = default;

LawState LawFit::start() const {
  LawState state;
  state.law = material::traits(setup_.law).name;
  state.values = parameters().starts();
  return state;
}

LawState LawFit::at_last_stage(std::vector<double> values) const {
  LawState state = start();
  state.values = std::move(values);
  state.begun = state.rescanned = true;
  state.stage = state.first_stage = stages_.size() - 1;
  return state;
}

fit::CaptureProblem LawFit::problem(double level, const fit::Window& window,
                                    const std::vector<fit::Parameter>& parameters) {
  return {model(level), runs(), parameters, setup_.fit->loss, window, fit::used_samples(runs())};
}

void LawFit::tell(const LawState& state, const std::string& stage, double part, double rms) const {
  if (!report) return;
  // The start takes as long as a stage or longer; iterations go quicker at a stage's end.
  double before = 0.0;
  double all = 0.0;
  for (std::size_t s = 0; s < stages_.size(); ++s) {
    double weight = (stages_[s].window.last_frame - stages_[s].window.first_frame + 1) /
                    std::pow(stages_[s].level, 2.0);
    if (stages_[s].last) weight *= 2.0;
    if (stages_[s].level < stages_[state.first_stage].level) weight *= kLedShare;
    if (s < state.stage) before += weight;
    all += weight;
    if (s == state.stage && state.search) {
      const double done = state.search->iteration + part;
      before += weight * done / (done + 3.0);
    }
  }
  FitReport said;
  said.stage = stage;
  said.fraction = state.begun
                      ? kStartShare + (1.0 - kStartShare) * std::clamp(before / all, 0.0, 1.0)
                      : kStartShare * state.evaluations / (state.evaluations + 10.0);
  said.iteration = state.search ? state.search->iteration + 1 : 0;
  said.rms = rms;
  report(said);
}

std::vector<double> LawFit::mean_distances(LawState& state,
                                           const std::vector<std::vector<double>>& points,
                                           const fit::Window& window, double level) {
  const fit::CaptureProblem at_level = problem(level, window);
  const auto progress = [&](double part) { tell(state, "looking for a start", part, told_); };
  progress(0.0);
  std::vector<double> means;
  const fit::Evaluation found = model(level).evaluate(points, {window.until}, progress);
  for (const auto& outcome : found.outcomes) {
    const double mean = outcome ? mean_of(at_level.distances(at_level.residuals(*outcome)))
                                : std::numeric_limits<double>::infinity();
    means.push_back(std::isfinite(mean) ? mean : std::numeric_limits<double>::infinity());
  }
  state.evaluations += static_cast<int>(points.size());
  told_ = *std::min_element(means.begin(), means.end());
  return means;
}

std::vector<double> LawFit::mean_distances(LawState& state,
                                           const std::vector<std::vector<double>>& points,
                                           const fit::Window& window) {
  return mean_distances(state, points, window, stages_[state.first_stage].level);
}

std::vector<double> LawFit::start_distances(LawState& state, const StartLimit& limit,
                                            const std::vector<std::vector<double>>& points,
                                            const fit::Window& window) {
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

void LawFit::choose_material(LawState& state) {
  const Stage& stage = stages_[state.stage];
  const bool finer = state.stage > 0 && stages_[state.stage - 1].level != stage.level;
  if (!finer || state.repeats > 0) return;
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

double LawFit::alike() const {
  double sigma = 0.0;
  for (const fit::Run& run : runs()) {
    for (const fit::Capture& capture : run.captures) {
      if (capture.used_count > 0) sigma = std::max(sigma, capture.cloud_scale().sigma);
    }
  }
  return fit::mean_length(sigma);
}

double LawFit::far() const {
  if (setup_.fit->loss == FitDoc::Loss::kTracks) return poor();
  return alike() * (setup_.fit->loss == FitDoc::Loss::kSurface ? kFarSurface : kFarCloud);
}

double LawFit::poor() const {
  if (setup_.fit->loss != FitDoc::Loss::kTracks) return kPoorCloud * alike();
  const auto& runs = this->runs();
  double sigma = 0.0;
  double size = 0.0;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (const fit::Capture& capture : runs[r].captures) {
      if (capture.used_count == 0) continue;
      double mean = 0.0;
      for (std::size_t i = 0; i < capture.sigma.size(); ++i) {
        mean += capture.deviation(i) / double(capture.sigma.size());
      }
      sigma = std::max(sigma, mean);
      const mpm::Scene& scene = scenes()[r];
      size = std::max(
          size, fit::body_size(scene.bodies[fit::body_index(scene, capture.input.body)].rest));
    }
  }
  return std::max(kPoorNoise * sigma, kPoorSize * size);
}

void LawFit::begin(LawState& state) {
  const auto& runs = this->runs();
  const MotionStart motion = with_initial_motion(runs, scenes(), parameters(), state.values);
  Start best;
  best.values = state.values;
  if (motion.flights != state.values) {
    const auto means =
        mean_distances(state, {state.values, motion.flights}, stages_.front().window);
    if (means[1] < means[0] || !std::isfinite(means[0])) best.values = motion.flights;
  }
  state.torn = !motion.contradicted.empty();
  // What a motion that is not quite right leads to later is no judge of a material.
  const fit::Window window = fit::first_window(runs, state.torn ? kFirstSamples : kScanSamples);
  best.mean = mean_distances(state, {best.values}, window).front();
  if (best.mean > poor()) {
    const StartLimit limit(runs, scenes(), parameters());
    EquationStart balance;
    if (setup_.fit->loss == FitDoc::Loss::kTracks) {
      balance =
          equation_start(runs, scenes(), parameters(), best.values, setup_.threads, interrupter_);
      bool softer = false;
      for (std::vector<double>& values : balance.candidates) {
        std::vector<double> softened = limit.softened(values);
        softer = softer || softened != values;
        values = std::move(softened);
      }
      if (softer) balance.statement += "; made softer, so that a run takes minutes at most";
      state.candidates = balance.candidates;
      state.candidates.push_back(parameters().starts());
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
      if (std::isfinite(other.mean)) state.other = std::move(other.values);
    }
    if (!best.statement.empty()) state.statements.push_back(std::move(best.statement));
  }
  state.values = std::move(best.values);
  while (best.scanned && skip_level(state)) {
  }
}

void LawFit::find_material(LawState& state, const fit::Window& window, const StartLimit& limit,
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
  if (start.mean <= poor()) return;
  const auto costs = [&](const auto& points) {
    return start_distances(state, limit, points, window);
  };
  constexpr int kFar = 8;
  const bool finely = setup_.fit->loss != FitDoc::Loss::kTracks;
  if (const auto flows = flow_starts(parameters(), scenes(), start.values); !flows.empty()) {
    take_flow(state, search_flows(parameters(), flows, costs, finely), start);
    return;
  }
  Scanned found = scanned(parameters(), start.values, start.mean, costs, kFar, finely);
  start.values = std::move(found.values);
  start.mean = found.cost;
  start.scanned = true;
}

void LawFit::take_flow(LawState& state, std::vector<FlowFound> found, Start& start) const {
  start.statement += (start.statement.empty() ? "" : " ") + flow_statement(found);
  if (found.front().at.cost < start.mean) {
    start.values = std::move(found.front().at.values);
    start.mean = found.front().at.cost;
  }
  start.scanned = true;
  // A class that is nearly as near may be the right one.
  constexpr double kNearlyAsNear = 1.5;
  if (found.size() > 1 && !state.torn && found[1].at.cost < kNearlyAsNear * start.mean) {
    state.other = std::move(found[1].at.values);
  }
}

std::vector<double> LawFit::with_law_of(std::vector<double> values,
                                        const std::vector<double>& material) const {
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (!parameters().path(k).quantity->law_parameter().empty()) values[k] = material[k];
  }
  return values;
}

bool LawFit::skip_level(LawState& state) {
  const double level = stages_[state.first_stage].level;
  const auto next = std::find_if(stages_.begin(), stages_.end(),
                                 [&](const Stage& stage) { return stage.level < level; });
  const bool free = setup_.fit->levels.empty() && setup_.fit->loss == FitDoc::Loss::kTracks;
  if (next == stages_.end() || !free) return false;
  const fit::Window window = fit::first_window(runs(), kScanSamples);
  const auto residuals = [&](double at) -> std::optional<Eigen::VectorXd> {
    ++state.evaluations;
    const std::vector<std::vector<double>> here{state.values};
    const auto outcome = model(at).evaluate(here, {window.until}).outcomes.front();
    if (!outcome) return std::nullopt;
    return problem(at, window).residuals(*outcome);
  };
  context_.reset();
  const auto coarse = residuals(level);
  if (!coarse) return false;
  const fit::CaptureProblem at_level = problem(level, window);
  const double missed = mean_of(at_level.distances(*coarse));
  if (missed <= far()) return false;
  const auto fine = residuals(next->level);
  if (!fine || mean_of(at_level.distances(*fine - *coarse)) <= kLevelGap * missed) return false;
  state.first_stage = static_cast<std::size_t>(next - stages_.begin());
  state.stage = state.first_stage;
  return true;
}

double LawFit::mean_missed(const LawState& state) {
  const std::vector<double> missed = distances(state);
  return missed.empty() ? std::numeric_limits<double>::infinity() : mean_of(missed);
}

bool LawFit::is_far(const LawState& state) {
  const double mean = mean_missed(state);
  if (!std::isfinite(mean)) return false;
  if (setup_.fit->loss == FitDoc::Loss::kTracks) return mean > far();
  // With what no captured point is near to.
  const Eigen::VectorXd& residual = state.search->residual;
  const double entries = 0.5 * double(residual.size());
  return std::sqrt(residual.squaredNorm() / entries) > far() / alike();
}

bool LawFit::at_first_level(const LawState& state) const {
  return stages_[state.stage].level == stages_[state.first_stage].level;
}

bool LawFit::may_rescan(const LawState& state) const {
  if (state.rescanned) return false;
  return state.torn ? at_first_level(state) : state.stage == state.first_stage;
}

bool LawFit::try_other_start(LawState& state) {
  if (state.other.empty() && state.ended.empty()) return false;
  const double mean = mean_missed(state);
  if (!state.other.empty()) {
    const std::vector<double> other = std::exchange(state.other, {});
    if (mean <= far()) return false;
    state.ended = std::exchange(state.values, other);
    state.ended_mean = mean;
    state.stage = state.first_stage;
    state.search.reset();
    return true;
  }
  const bool nearer = mean <= state.ended_mean;
  state.statements.push_back(
      fmt::format("That search ended {:.3g} mm off on the mean, and one that began with the other "
                  "{} {:.3g} mm: the {} is taken.",
                  1e3 * state.ended_mean, state.torn ? "motion" : "class", 1e3 * mean,
                  nearer ? "second" : "first"));
  if (!nearer) return back_to_first_start(state);
  state.ended.clear();
  return false;
}

bool LawFit::back_to_first_start(LawState& state) const {
  if (state.ended.empty()) return false;
  state.values = std::exchange(state.ended, {});
  while (!stages_[state.stage].whole) ++state.stage;
  state.search.reset();
  return true;
}

bool LawFit::rescan(LawState& state) {
  context_.reset();
  const fit::Window window = fit::first_window(runs(), kScanSamples);
  const double mean = mean_distances(state, {state.values}, window).front();
  const StartLimit limit(runs(), scenes(), parameters());
  const auto costs = [&](const auto& points) {
    return start_distances(state, limit, points, window);
  };
  std::vector<double> found = scanned(parameters(), state.values, mean, costs, kNear,
                                      setup_.fit->loss != FitDoc::Loss::kTracks)
                                  .values;
  if (found == state.values) return false;
  state.values = std::move(found);
  state.candidates.push_back(state.values);
  return true;
}

std::vector<fit::Parameter> LawFit::stage_parameters(const LawState& state) const {
  std::vector<fit::Parameter> parameters = this->parameters().parameters();
  const bool last = stages_[state.stage].last;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    fit::Parameter& parameter = parameters[k];
    parameter.start = std::clamp(state.stage_start[k], parameter.low, parameter.high);
    if (last || parameter.prior) continue;
    parameter.prior = fit::Prior{fit::to_natural(parameter.coordinate, parameter.start),
                                 kLeash * parameter.scale};
  }
  return parameters;
}

LawFit::Context& LawFit::context(const LawState& state) {
  const Stage& stage = stages_[state.stage];
  if (context_ && context_->stage == state.stage && context_->repeats == state.repeats) {
    return *context_;
  }
  const std::vector<fit::Parameter> of_stage = stage_parameters(state);
  fit::LeastSquaresOptions options;
  options.iterations = setup_.fit->iterations;
  options.huber = setup_.fit->huber;
  if (!stage.last) {
    options.iterations = std::min(options.iterations, kShortStage);
    options.step_tolerance = kCoarseStep;
    options.cost_tolerance = kCoarseCost;
    options.thorough = false;
  }
  const auto stepped = [&](double level, const std::vector<fit::RunSteps>& steps) {
    fit::CaptureProblem at_level = problem(level, stage.window, of_stage);
    at_level.set_plan(fit::StepPlan(steps));
    return at_level;
  };
  context_ = std::make_unique<Context>(Context{state.stage, state.repeats,
                                               stepped(stage.level, state.steps),
                                               fit::LeastSquares(of_stage, options), std::nullopt});
  if (stage.stand_in && !state.stand_in_steps.empty()) {
    context_->stand_in.emplace(stepped(*stage.stand_in, state.stand_in_steps));
    context_->problem.set_stand_in(&*context_->stand_in);
  }
  return *context_;
}

std::optional<std::vector<fit::RunSteps>> LawFit::fix(double level, LawState& state,
                                                      const fit::Window& window,
                                                      fit::Failure& failure) {
  const std::vector<std::vector<double>> here{state.values};
  fit::Evaluation found = model(level).evaluate(here, {window.until});
  ++state.evaluations;
  failure = std::move(found.failure);
  if (!found.outcomes.front()) return std::nullopt;
  return model(level).plan_of(state.values, *found.outcomes.front()).runs;
}

void LawFit::set_stage(LawState& state) {
  const Stage& stage = stages_[state.stage];
  context_.reset();
  tell(state, stage.name, 0.0, std::numeric_limits<double>::quiet_NaN());
  choose_material(state);
  fit::Failure failure;
  const auto steps = fix(stage.level, state, stage.window, failure);
  if (!steps) {
    const std::string why = "The simulation could not be completed: " + failure.message;
    if (state.iterations == 0) {
      if (failure.by_input) throw_input(failure.message);
      throw_compute("the fit cannot begin at these values. " + why);
    }
    if (back_to_first_start(state)) return;
    state.finished = true;
    state.converged = false;
    state.reason = "Stopped before the stage " + stage.name + ". " + why;
    return;
  }
  state.steps = *steps;
  state.stand_in_steps.clear();
  if (stage.stand_in && stages_[state.first_stage].level > stage.level) {
    if (auto coarse = fix(*stage.stand_in, state, stage.window, failure)) {
      state.stand_in_steps = std::move(*coarse);
    }
  }
  state.stage_start = state.values;
  state.refinements.clear();
  state.search = context(state).search.start();
}

void LawFit::end_stage(LawState& state) {
  // Where the first motion or the class was not known the whole clip is what tells a wrong valley.
  const bool one = !state.torn && state.other.empty() && state.ended.empty();
  const bool judged = one || (stages_[state.stage].whole && at_first_level(state));
  if (judged && try_other_start(state)) return;
  if (judged && may_rescan(state) && is_far(state)) {
    state.scan_due = true;
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
                  [](int power) { return power != 0 && power != fit::StepPlan::kUnsettled; });
  if (other_steps && state.repeats < kMostRepeats) {
    ++state.repeats;
    state.search.reset();
    return;
  }
  state.finished = true;
  state.converged = state.search->converged;
  state.reason = state.search->reason;
}

void LawFit::take_standing(LawState& state, int iterations_before) {
  const fit::LeastSquaresState& search = *state.search;
  const bool due = search.finished || search.iteration / kIterationsToStanding >
                                          iterations_before / kIterationsToStanding;
  if (!due || search.residual.size() == 0) return;
  const fit::CaptureProblem& problem = context(state).problem;
  const bool far = is_far(state);
  const Stage& stage = stages_[state.stage];
  const bool early = far && may_rescan(state);
  // A coarse grid may be why.
  if (early && stage.level != stages_.back().level) return;
  add_standing(state, {problem.rms(search.residual), stage.whole && !early, far});
}

void LawFit::advance(LawState& state, std::vector<Json>& history) {
  if (state.finished) return;
  if (parameters().size() == 0) {
    state.finished = true;
    state.converged = true;
    state.reason = "No parameter is of this law: it is taken as the document has it.";
    return;
  }
  if (!state.begun) {
    LawState next = state;
    begin(next);
    next.begun = true;
    next.candidates.push_back(next.values);
    state = std::move(next);
    return;
  }
  if (state.scan_due) {
    LawState next = state;
    next.scan_due = false;
    if (skip_level(next)) {
      next.candidates.push_back(next.values);
      next.search.reset();
      state = std::move(next);
      return;
    }
    next.rescanned = true;
    if (rescan(next)) {
      next.search.reset();
    } else {
      end_stage(next);
    }
    state = std::move(next);
    return;
  }
  if (!state.search) {
    LawState next = state;
    set_stage(next);
    state = std::move(next);
    return;
  }
  LawState next = state;
  Context& at = context(next);
  const std::string& name = stages_[next.stage].name;
  fit::LeastSquaresState& search = *next.search;
  const auto rms_now = [&] {
    return search.residual.size() > 0 ? at.problem.rms(search.residual)
                                      : std::numeric_limits<double>::quiet_NaN();
  };
  const double before_rms = rms_now();
  at.problem.forget();
  settle(next);
  const std::size_t known = search.history.size();
  const int evaluations = search.evaluations;
  const int iterations = search.iteration;
  const Eigen::VectorXd from = search.point;
  try {
    const Told told(at.problem, [&](double part) { tell(state, name, part, before_rms); });
    at.search.iterate(at.problem, search);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kCompute) throw;
    if (state.iterations == 0) throw_compute(std::string("fit: ") + error.what());
    if (back_to_first_start(state)) return;
    state.finished = true;
    state.converged = false;
    state.reason = "Stopped in the stage " + name + ": " + error.what();
    return;
  }
  next.evaluations += search.evaluations - evaluations;
  next.iterations += search.iteration - iterations;
  next.values = at.problem.physical(search.point);
  for (std::size_t k = known; k < search.history.size(); ++k) {
    const fit::LeastSquaresStep& step = search.history[k];
    const bool moved = step.iteration > iterations;
    const double rms = !step.accepted ? std::numeric_limits<double>::quiet_NaN()
                       : moved        ? rms_now()
                                      : at.problem.rms_seen(from);
    Json values;
    if (step.accepted && moved) {
      for (std::size_t p = 0; p < next.values.size(); ++p) {
        values[parameters().parameters()[p].name] = next.values[p];
      }
    }
    history.push_back({{"stage", name},
                       {"law", next.law},
                       {"iteration", step.iteration},
                       {"cost", step.cost},
                       {"rms_mm", std::isfinite(rms) ? Json(1e3 * rms) : Json()},
                       {"accepted", step.accepted},
                       {"evaluations", next.evaluations},
                       {"values", values}});
  }
  take_standing(next, iterations);
  if (search.finished) end_stage(next);
  state = std::move(next);
}

void LawFit::settle(LawState& state) {
  const Stage& stage = stages_[state.stage];
  Context& at = context(state);
  const std::vector<double> values = at.problem.physical(state.search->point);
  const auto settled = [&](double level, fit::CaptureProblem& of, std::span<const int> before) {
    fit::StepPlan plan = of.plan();
    model(level).settle(plan, values, before);
    of.set_plan(std::move(plan));
  };
  settled(stage.level, at.problem, state.refinements);
  if (at.stand_in) settled(*stage.stand_in, *at.stand_in, {});
  const std::vector<int>& refinements = at.problem.plan().refinements;
  if (state.refinements == refinements) return;
  // With other substeps the residuals are not quite the same.
  state.refinements = refinements;
  state.search->residual.resize(0);
  state.search->forget_slopes();
}

fit::Uncertainty LawFit::uncertainty(const LawState& state) {
  LawState at_end = state;
  Context& at = context(at_end);
  settle(at_end);
  fit::LeastSquaresState& search = *at_end.search;
  at.search.linearise(at.problem, search);
  fit::Uncertainty known =
      fit::uncertainty(at.search.parameters(), search, at.problem.effective(search.residual),
                       setup_.fit->huber, at.problem.blocks(), is_far(at_end));
  for (std::size_t k = 0; k < known.estimates.size(); ++k) {
    if (known.estimates[k].observable || !is_unseen(parameters().path(k), runs())) continue;
    known.estimates[k].statement = at.search.parameters()[k].name +
                                   " is not observed: the fit sees nothing of its capture, which "
                                   "is held out or outside of the scene's frames. It keeps its "
                                   "start value.";
  }
  if (const auto change = coarser(at_end)) {
    fit::add_grid_error(at.search.parameters(), search, *change, kOfCoarser, setup_.fit->huber,
                        known);
  }
  return known;
}

std::vector<std::size_t> LawFit::excited(const LawState& state, std::size_t first) {
  LawState begun = state;
  if (!begun.search) set_stage(begun);
  if (!begun.search) throw_compute(begun.reason);
  Context& at = context(begun);
  settle(begun);
  at.search.linearise(at.problem, *begun.search);
  return fit::excited(at.search.parameters(), begun.search->jacobian, first);
}

std::optional<Eigen::VectorXd> LawFit::coarser(const LawState& state) {
  const Stage& stage = stages_[state.stage];
  try {
    const double level = kCoarser * stage.level;
    const std::vector<std::vector<double>> here{state.values};
    const fit::Evaluation found = model(level).evaluate(here, {stage.window.until});
    if (!found.outcomes.front()) throw_compute(found.failure.message);
    return problem(level, stage.window).residuals(*found.outcomes.front()) - state.search->residual;
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kInput && error.kind() != ErrorKind::kCompute) throw;
    statements_.push_back(
        std::string("What the grid makes of the values is not known: with twice the particle "
                    "separation the scene could not be simulated (") +
        error.what() + ")");
    return std::nullopt;
  }
}

std::vector<double> LawFit::distances(const LawState& state) {
  if (!state.search || state.search->residual.size() == 0) return {};
  return context(state).problem.distances(state.search->residual);
}

std::optional<ErrorPool> LawFit::errors(const LawState& state, bool fitted, std::string& failure) {
  context_.reset();
  const auto progress = [&](double part) {
    tell(state, fitted ? "predicting" : "the start", part,
         std::numeric_limits<double>::quiet_NaN());
  };
  fit::Ask ask;
  ask.query.values = state.values;
  fit::Evaluation found = predictor_.predict({ask}, false, progress);
  if (!found.outcomes.front()) {
    failure = found.failure.message;
    if (!fitted && found.failure.by_input) throw_input(failure);
    return std::nullopt;
  }
  return errors_of(runs(), model(1.0), setup_.fit->loss, *found.outcomes.front());
}

}  // namespace matterfit::job
