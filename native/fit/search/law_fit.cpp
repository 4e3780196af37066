// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/law_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "base/error.hpp"
#include "fit/numerics/excited.hpp"
#include "fit/search/levels.hpp"
#include "fit/search/race.hpp"
#include "fit/search/value_errors.hpp"

namespace matterfit::fit {
namespace {

/// Stages before the last: how far is far enough.
constexpr int kShortStage = 8;
constexpr double kCoarseStep = 2e-2;
constexpr double kCoarseCost = 1e-3;
/// Until the last stage what a short clip hardly shows stays near where it was: the standard
/// deviation of that, in scales of the parameters.
constexpr double kLeash = 2.0;
/// Of the last stage, with the substeps that the solver takes at its end.
constexpr int kMostRepeats = 1;
/// Iterations from one comparison of candidate laws to the next.
constexpr int kIterationsToStanding = 5;

/// The document's levels, or the usual ones.
std::vector<double> levels_of(const SearchProblems& problems) {
  std::vector<double> levels = problems.setup().options.levels;
  if (levels.empty()) levels = usual_levels(problems.scenes());
  return levels;
}

/// Has a problem tell its progress for as long as this stands.
class Told {
 public:
  Told(CaptureProblem& problem, std::function<void(double)> tell) : problem_(problem) {
    tell(0.0);
    problem_.progress = std::move(tell);
  }
  ~Told() { problem_.progress = {}; }
  Told(const Told&) = delete;
  Told& operator=(const Told&) = delete;

 private:
  CaptureProblem& problem_;
};

}  // namespace

struct LawFit::Context {
  std::size_t stage;
  int repeats;
  CaptureProblem problem;
  LeastSquares search;
  std::optional<CaptureProblem> stand_in;
};

LawFit::LawFit(SearchSetup setup, const Interrupter& interrupter,
               std::vector<std::string>& statements)
    : statements_(statements),
      problems_(std::move(setup), interrupter),
      stages_(stages_of(levels_of(problems_),
                        growing_windows(problems_.runs(), problems_.setup().options.windows))),
      starts_(problems_, stages_, interrupter,
              [this](const LawState& state, const std::string& what, double part, double rms) {
                tell(state, what, part, rms);
              }) {}

LawFit::~LawFit() = default;

LawState LawFit::start() const {
  LawState state;
  state.law = material::traits(problems_.setup().law).name;
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

void LawFit::tell(const LawState& state, const std::string& stage, double part, double rms) const {
  if (!report) return;
  SearchProgress said;
  said.stage = stage;
  said.fraction = fraction_done(stages_, state, part);
  said.iteration = state.search ? state.search->iteration + 1 : 0;
  said.rms = rms;
  report(said);
}

double LawFit::mean_missed(const LawState& state) {
  const std::vector<double> missed = distances(state);
  return missed.empty() ? std::numeric_limits<double>::infinity() : mean_value(missed);
}

bool LawFit::is_far(const LawState& state) {
  const double mean = mean_missed(state);
  if (!std::isfinite(mean)) return false;
  if (problems_.setup().options.loss == Loss::kTracks) return mean > problems_.far();
  // With what no captured point is near to.
  const Eigen::VectorXd& residual = state.search->residual;
  const double entries = 0.5 * double(residual.size());
  return std::sqrt(residual.squaredNorm() / entries) > problems_.far() / problems_.alike();
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
    if (mean <= problems_.far()) return false;
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

std::vector<Parameter> LawFit::stage_parameters(const LawState& state) const {
  std::vector<Parameter> parameters = this->parameters().parameters();
  const bool last = stages_[state.stage].last;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    Parameter& parameter = parameters[k];
    parameter.start = std::clamp(state.stage_start[k], parameter.low, parameter.high);
    if (last || parameter.prior) continue;
    parameter.prior =
        Prior{to_natural(parameter.coordinate, parameter.start), kLeash * parameter.scale};
  }
  return parameters;
}

LawFit::Context& LawFit::context(const LawState& state) {
  const SearchStage& stage = stages_[state.stage];
  if (context_ && context_->stage == state.stage && context_->repeats == state.repeats) {
    return *context_;
  }
  const std::vector<Parameter> of_stage = stage_parameters(state);
  LeastSquaresOptions options;
  options.iterations = problems_.setup().options.iterations;
  options.huber = problems_.setup().options.huber;
  if (!stage.last) {
    options.iterations = std::min(options.iterations, kShortStage);
    options.step_tolerance = kCoarseStep;
    options.cost_tolerance = kCoarseCost;
    options.thorough = false;
  }
  const auto stepped = [&](double level, const std::vector<RunSteps>& steps) {
    CaptureProblem at_level = problems_.problem(level, stage.window, of_stage);
    at_level.set_plan(StepPlan(steps));
    return at_level;
  };
  context_ = std::make_unique<Context>(Context{state.stage, state.repeats,
                                               stepped(stage.level, state.steps),
                                               LeastSquares(of_stage, options), std::nullopt});
  if (stage.stand_in && !state.stand_in_steps.empty()) {
    context_->stand_in.emplace(stepped(*stage.stand_in, state.stand_in_steps));
    context_->problem.set_stand_in(&*context_->stand_in);
  }
  return *context_;
}

std::optional<std::vector<RunSteps>> LawFit::fix(double level, LawState& state,
                                                 const Window& window, Failure& failure) {
  const std::vector<std::vector<double>> here{state.values};
  Evaluation found = problems_.model(level).evaluate(here, {window.until});
  ++state.evaluations;
  failure = std::move(found.failure);
  if (!found.outcomes.front()) return std::nullopt;
  return problems_.model(level).plan_of(state.values, *found.outcomes.front()).runs;
}

void LawFit::set_stage(LawState& state) {
  const SearchStage& stage = stages_[state.stage];
  context_.reset();
  tell(state, stage.name, 0.0, std::numeric_limits<double>::quiet_NaN());
  starts_.choose_material(state);
  Failure failure;
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
                  [](int power) { return power != 0 && power != StepPlan::kUnsettled; });
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
  const LeastSquaresState& search = *state.search;
  const bool due = search.finished || search.iteration / kIterationsToStanding >
                                          iterations_before / kIterationsToStanding;
  if (!due || search.residual.size() == 0) return;
  const CaptureProblem& problem = context(state).problem;
  const bool far = is_far(state);
  const SearchStage& stage = stages_[state.stage];
  const bool early = far && may_rescan(state);
  // A coarse grid may be why.
  if (early && stage.level != stages_.back().level) return;
  add_standing(state, {problem.rms(search.residual), stage.whole && !early, far});
}

void LawFit::advance(LawState& state, std::vector<SearchStep>& history) {
  if (state.finished) return;
  if (parameters().size() == 0) {
    state.finished = true;
    state.converged = true;
    state.reason = "No parameter is of this law: it is taken as the document has it.";
    return;
  }
  if (!state.begun) {
    LawState next = state;
    context_.reset();
    starts_.begin(next);
    next.begun = true;
    next.candidates.push_back(next.values);
    state = std::move(next);
    return;
  }
  if (state.scan_due) {
    LawState next = state;
    context_.reset();  // what follows simulates without it
    next.scan_due = false;
    if (starts_.skip_level(next)) {
      next.candidates.push_back(next.values);
      next.search.reset();
      state = std::move(next);
      return;
    }
    next.rescanned = true;
    if (starts_.rescan(next)) {
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
  LeastSquaresState& search = *next.search;
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
    const LeastSquaresStep& step = search.history[k];
    const bool moved = step.iteration > iterations;
    const double rms = !step.accepted ? std::numeric_limits<double>::quiet_NaN()
                       : moved        ? rms_now()
                                      : at.problem.rms_seen(from);
    SearchStep& taken = history.emplace_back();
    taken.stage = name;
    taken.law = next.law;
    taken.iteration = step.iteration;
    taken.cost = step.cost;
    taken.rms = rms;
    taken.accepted = step.accepted;
    taken.evaluations = next.evaluations;
    if (step.accepted && moved) taken.values = next.values;
  }
  take_standing(next, iterations);
  if (search.finished) end_stage(next);
  state = std::move(next);
}

void LawFit::settle(LawState& state) {
  const SearchStage& stage = stages_[state.stage];
  Context& at = context(state);
  const std::vector<double> values = at.problem.physical(state.search->point);
  const auto settled = [&](double level, CaptureProblem& of, std::span<const int> before) {
    StepPlan plan = of.plan();
    problems_.model(level).settle(plan, values, before);
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

Uncertainty LawFit::uncertainty(const LawState& state) {
  LawState at_end = state;
  Context& at = context(at_end);
  settle(at_end);
  at.search.linearise(at.problem, *at_end.search);
  return errors_of_values(problems_, stages_[at_end.stage], at.problem, at.search.parameters(),
                          at_end, is_far(at_end), statements_);
}

void LawFit::compare(LawState& state) {
  if (!state.search) set_stage(state);
  if (!state.search) throw_compute(state.reason);
  Context& at = context(state);
  settle(state);
  if (state.search->residual.size() > 0) return;
  const auto found = at.problem.evaluate({state.search->point});
  ++state.evaluations;
  if (!found.front()) throw_compute("fit: the simulation could not be completed.");
  state.search->residual = *found.front();
}

std::optional<std::vector<double>> LawFit::published_slope(const LawState& state,
                                                           const std::string& body) {
  if (!state.search || state.search->residual.size() == 0) return std::nullopt;
  CaptureProblem& problem = context(state).problem;
  const Told told(problem, [&](double part) {
    tell(state, "weights", part, problem.rms(state.search->residual));
  });
  return problem.transposed_published(state.search->point, state.search->residual, body);
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

std::vector<double> LawFit::distances(const LawState& state) {
  if (!state.search || state.search->residual.size() == 0) return {};
  return context(state).problem.distances(state.search->residual);
}

std::optional<Outcome> LawFit::predict(const LawState& state, bool fitted, std::string& failure) {
  context_.reset();
  const auto progress = [&](double part) {
    tell(state, fitted ? "predicting" : "the start", part,
         std::numeric_limits<double>::quiet_NaN());
  };
  Ask ask;
  ask.query.values = state.values;
  Evaluation found = problems_.predictor().predict({ask}, false, progress);
  if (!found.outcomes.front()) {
    failure = found.failure.message;
    if (!fitted && found.failure.by_input) throw_input(failure);
    return std::nullopt;
  }
  return std::move(found.outcomes.front());
}

}  // namespace matterfit::fit
