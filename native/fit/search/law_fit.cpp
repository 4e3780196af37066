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
#include "fit/search/value_errors.hpp"

namespace matterfit::fit {
namespace {

/// Stages before the last: how far is far enough.
constexpr int kShortStage = 8;
constexpr double kCoarseStep = 2e-2;
constexpr double kCoarseCost = 1e-3;
/// All stages but the last add a Gaussian prior about the stage's start, so that parameters that a
/// short window does not constrain do not drift. Its standard deviation, in units of
/// Parameter::scale.
constexpr double kLeash = 2.0;

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
              }),
      phases_(stages_, *this) {}

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
  state.phase = InStage{};
  state.rescanned = true;
  state.stage = state.first_stage = stages_.size() - 1;
  return state;
}

void LawFit::tell(const LawState& state, const std::string& what, double part, double rms) const {
  SearchProgress said;
  said.stage = what;
  said.rms = rms;
  tell(state, std::move(said), part);
}

void LawFit::tell_stage(const LawState& state, double part, double rms) const {
  SearchProgress said;
  said.stage = stages_[state.stage].frames;
  said.level = stages_[state.stage].level;
  said.rms = rms;
  tell(state, std::move(said), part);
}

void LawFit::tell(const LawState& state, SearchProgress said, double part) const {
  if (!report) return;
  said.fraction = fraction_done(stages_, state, part);
  said.iteration = state.search ? state.search->iteration + 1 : 0;
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
  // The whole residual, with rows for simulated points far from every captured one, which
  // distances() omits.
  const Eigen::VectorXd& residual = state.search->residual;
  const double entries = 0.5 * double(residual.size());
  return std::sqrt(residual.squaredNorm() / entries) > problems_.far() / problems_.alike();
}

double LawFit::rms_missed(const LawState& state) {
  return context(state).problem.rms(state.search->residual);
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

void LawFit::find_start(LawState& state) {
  context_.reset();
  starts_.begin(state);
}

bool LawFit::skip_level(LawState& state) {
  context_.reset();  // what follows simulates without it
  return starts_.skip_level(state);
}

bool LawFit::rescan(LawState& state) { return starts_.rescan(state); }

std::optional<Failure> LawFit::begin_stage(LawState& state) {
  const SearchStage& stage = stages_[state.stage];
  context_.reset();
  tell_stage(state, 0.0, std::numeric_limits<double>::quiet_NaN());
  starts_.choose_material(state);
  Failure failure;
  const auto steps = fix(stage.level, state, stage.window, failure);
  if (!steps) return failure;
  state.steps = *steps;
  state.stand_in_steps.clear();
  if (stage.stand_in && stages_[state.first_stage].level > stage.level) {
    if (auto coarse = fix(*stage.stand_in, state, stage.window, failure)) {
      state.stand_in_steps = std::move(*coarse);
    }
  }
  state.stage_start = state.values;
  state.refinements.clear();
  state.nearest.reset();
  state.search = context(state).search.start();
  return std::nullopt;
}

std::optional<LawState> LawFit::iterated(const LawState& state, std::vector<SearchStep>& history,
                                         std::string& failure) {
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
    const Told told(at.problem, [&](double part) { tell_stage(state, part, before_rms); });
    at.search.iterate(at.problem, search);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kCompute) throw;
    failure = error.what();
    return std::nullopt;
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
  const bool again = search.history.size() > known && search.history[known].iteration == iterations;
  const double began_with = again ? search.history[known].cost : state.search->cost;
  if (leads_astray(next.nearest, began_with, from) && !end_at_nearest(next)) {
    failure = "the simulation could not be completed where the search had come nearest.";
    return std::nullopt;
  }
  return next;
}

bool LawFit::end_at_nearest(LawState& state) {
  LeastSquaresState& search = *state.search;
  search.point = state.nearest->point;
  search.residual.resize(0);
  state.refinements.clear();
  if (!observe(state)) return false;
  state.values = context(state).problem.physical(search.point);
  search.finish(true,
                "With the substeps that they take, further steps missed the capture by more: the "
                "values that came nearest are taken.");
  return true;
}

bool LawFit::observe(LawState& state) {
  Context& at = context(state);
  settle(state);
  if (state.search->residual.size() > 0) return true;
  const auto found = at.problem.evaluate({state.search->point});
  ++state.evaluations;
  if (!found.front()) return false;
  state.search->residual = *found.front();
  return true;
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
  if (!state.search) phases_.begin_stage(state);
  if (!state.search) throw_compute(state.reason());
  if (!observe(state)) throw_compute("fit: the simulation could not be completed.");
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
  if (!begun.search) phases_.begin_stage(begun);
  if (!begun.search) throw_compute(begun.reason());
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
