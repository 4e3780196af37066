// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/study.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

#include "base/error.hpp"
#include "diagnose/observe.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

bool is_observation(const Model& model, int effect) {
  return model.effects()[std::size_t(effect)].observation != Observation::kNone;
}

VectorXd neutral_values(const Effect& effect) {
  VectorXd values(Index(effect.numbers.size()));
  for (std::size_t k = 0; k < effect.numbers.size(); ++k) {
    values[Index(k)] = effect.numbers[k].neutral;
  }
  return values;
}

/// Moves Point::until on to the last of these rows.
void look_until(const Rows& rows, std::vector<double>& until) {
  for (const Series& s : rows.series()) {
    double& last = until[std::size_t(s.capture)];
    last = std::max(last, rows.time(s.end - 1));
  }
}

/// One derivative: states on either side of the present one, and how far they are.
struct Difference {
  std::optional<State> above;
  std::optional<State> below;
  double up = 0.0;  ///< in scales
  double down = 0.0;
  bool observed = false;  ///< the motion is the present one's
};

Difference theta_difference(const Model& model, const State& state, Index p,
                            const DifferenceOptions& options) {
  const fit::Parameter& parameter = model.parameters()[std::size_t(p)];
  const double low = fit::to_natural(parameter.coordinate, parameter.low);
  const double high = fit::to_natural(parameter.coordinate, parameter.high);
  const double step = options.step * parameter.scale;
  Difference result;
  const auto moved = [&](double by) {
    State other = state;
    other.theta[p] += by;
    return other;
  };
  const bool room_above = state.theta[p] + step <= high;
  const bool room_below = state.theta[p] - step >= low;
  if (room_above || !room_below) {
    result.above = moved(step);
    result.up = options.step;
  }
  if (room_below && (options.central || !room_above)) {
    result.below = moved(-step);
    result.down = options.step;
  }
  return result;
}

/// The difference by number k of the cause `c`, of a state that has it.
Difference cause_difference(const Model& model, const State& state, std::size_t c, Index k,
                            bool central) {
  const Active& cause = state.causes[c];
  const Number& number = model.effects()[std::size_t(cause.effect)].numbers[std::size_t(k)];
  const bool first = cause.values[k] == number.neutral && number.first_step > 0.0;
  const double step = first ? number.first_step : 1e-2 * number.scale;
  const double low = number.one_sided ? number.neutral : number.low;
  Difference result;
  result.observed = is_observation(model, cause.effect) && !model.follows_recordings();
  const auto moved = [&](double by) {
    State other = state;
    other.causes[c].values[k] += by;
    return other;
  };
  const bool room_above = cause.values[k] + step <= number.high;
  const bool room_below = cause.values[k] - step >= low;
  if (room_above || !room_below) {
    result.above = moved(step);
    result.up = step / number.scale;
  }
  if (room_below && (central || result.observed || !room_above)) {
    result.below = moved(-step);
    result.down = step / number.scale;
  }
  return result;
}

}  // namespace

Study::Study(const Model& model, Index limit)
    : Study(model, Rows(model.captures(), Use::kUsed, limit),
            Rows(model.captures(), Use::kHeldOut, limit), std::make_shared<Ledger>()) {}

Study::Study(const Study& other, Rows used, Rows held)
    : Study(*other.model_, std::move(used), std::move(held), other.ledger_) {}

Study::Study(const Model& model, Rows used, Rows held, std::shared_ptr<Ledger> ledger)
    : model_(&model), used_(std::move(used)), held_(std::move(held)), ledger_(std::move(ledger)) {
  if (used_.size() == 0)
    throw_input("No sample of the captures is used: all are held out or lost.");
  measured_ = stack(diagnose::measured(model.captures()));
  for (const Capture& capture : model.captures()) {
    used_until_.push_back(capture.times.front() - 1.0);
  }
  look_until(used_, used_until_);
  until_ = used_until_;
  look_until(held_, until_);
}

Point Study::point_of(const State& state, Wanted wanted) const {
  Point point{state.theta, {}, {}, wanted == Wanted::kUsed ? used_until_ : until_};
  for (const Active& cause : state.causes) {
    const bool observed = is_observation(*model_, cause.effect);
    if (observed) point.until.clear();  // a camera may see a sample at another time
    if (observed && !model_->follows_recordings()) continue;
    point.causes.push_back({cause.effect, cause.variant, cause.values});
  }
  return point;
}

Rows Study::used_in(const std::function<bool(int, Index)>& selected) const {
  std::set<std::pair<int, Index>> tracks;
  for (const Series& s : used_.series()) tracks.insert({s.capture, s.track});
  const std::vector<Capture>& captures = model_->captures();
  return Rows(captures, [&](int c, Index frame, Index track) {
    const Capture& capture = captures[std::size_t(c)];
    return capture.use[std::size_t(frame * capture.tracks() + track)] == Use::kUsed &&
           tracks.contains({c, track}) && selected(c, frame);
  });
}

void Study::begin(const std::string& stage, bool search) const {
  std::vector<Ledger::Stage>& stages = ledger_->stages;
  if (stages.size() == 1 && stages.front().runs == 0) stages.front() = {stage, 0, search, 0.0};
  const auto found =
      std::ranges::find_if(stages, [&](const Ledger::Stage& s) { return s.name == stage; });
  ledger_->current = std::size_t(found - stages.begin());
  if (found == stages.end()) stages.push_back({stage, 0, search, 0.0});
}

int Study::runs() const {
  int sum = 0;
  for (const Ledger::Stage& stage : ledger_->stages) sum += stage.runs;
  return sum;
}

double Study::search_work() const {
  double sum = 0.0;
  for (const Ledger::Stage& stage : ledger_->stages) {
    if (stage.search) sum += stage.work;
  }
  return sum;
}

std::vector<std::optional<Motion>> Study::simulate(const std::vector<Point>& points) const {
  auto motions = model_->simulate(points);
  Ledger::Stage& stage = ledger_->stages[ledger_->current];
  stage.runs += int(points.size());
  for (const std::optional<Motion>& motion : motions) stage.work += motion ? motion->work : 1.0;
  return motions;
}

VectorXd Study::stack(const VectorXd& motion) const {
  VectorXd result(size());
  result << used_.gather(motion), held_.gather(motion);
  return result;
}

State Study::fitted() const {
  State state;
  const auto& parameters = model_->parameters();
  state.theta.resize(Index(parameters.size()));
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    state.theta[Index(p)] = fit::to_natural(parameters[p].coordinate, parameters[p].start);
  }
  return state;
}

std::vector<std::optional<Motion>> Study::motions(const std::vector<State>& states,
                                                  Wanted wanted) const {
  std::vector<Point> points;
  points.reserve(states.size());
  for (const State& state : states) points.push_back(point_of(state, wanted));
  return simulate(points);
}

VectorXd Study::seen(const Motion& motion, const State& state) const {
  std::vector<Observed> observations;
  for (const Active& cause : state.causes) {
    if (!is_observation(*model_, cause.effect)) continue;
    observations.push_back({&model_->effects()[std::size_t(cause.effect)], cause.values});
  }
  return stack(observe(motion, model_->captures(), observations));
}

std::vector<std::optional<VectorXd>> Study::predict(const std::vector<State>& states,
                                                    Wanted wanted) const {
  const auto runs = motions(states, wanted);
  std::vector<std::optional<VectorXd>> result(states.size());
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (runs[i]) result[i] = seen(*runs[i], states[i]);
  }
  return result;
}

std::vector<std::optional<VectorXd>> Study::predict_variants(
    const std::vector<State>& states, const std::vector<Numerics>& variants,
    const std::vector<std::vector<double>>& until) const {
  std::vector<Point> points;
  points.reserve(variants.size());
  for (std::size_t i = 0; i < variants.size(); ++i) {
    points.push_back(point_of(states[i], Wanted::kAll));
    points.back().numerics = variants[i];
    if (!until.empty()) points.back().until = until[i];
  }
  const auto runs = simulate(points);
  std::vector<std::optional<VectorXd>> result(variants.size());
  for (std::size_t i = 0; i < variants.size(); ++i) {
    if (runs[i]) result[i] = seen(*runs[i], states[i]);
  }
  return result;
}

std::vector<Candidate> candidates_of(const Model& model, const State& state) {
  std::vector<Candidate> result;
  for (std::size_t e = 0; e < model.effects().size(); ++e) {
    const bool active = std::ranges::any_of(
        state.causes, [&](const Active& cause) { return cause.effect == int(e); });
    if (active || model.effects()[e].last) continue;
    const int shapes = std::max(1, int(model.effects()[e].variants.size()));
    for (int v = 0; v < shapes; ++v) result.push_back({int(e), v});
  }
  return result;
}

Linearised linearise(const Study& study, const State& state,
                     const std::vector<Candidate>& candidates, const DifferenceOptions& options) {
  const Model& model = study.model();
  std::vector<Difference> differences;
  for (Index p = 0; p < state.theta.size(); ++p) {
    const bool left_out = std::ranges::count(options.left_out, p) > 0;
    differences.push_back(left_out ? Difference{} : theta_difference(model, state, p, options));
  }
  for (std::size_t c = 0; c < state.causes.size(); ++c) {
    for (Index k = 0; k < state.causes[c].values.size(); ++k) {
      differences.push_back(cause_difference(model, state, c, k, options.central));
    }
  }
  const std::size_t of_state = differences.size();
  for (const Candidate& candidate : candidates) {
    const Effect& effect = model.effects()[std::size_t(candidate.effect)];
    State extended = state;
    extended.causes.push_back({candidate.effect, candidate.variant, neutral_values(effect)});
    const std::size_t count = std::min(effect.numbers.size(), options.numbers);
    for (std::size_t k = 0; k < count; ++k) {
      differences.push_back(
          cause_difference(model, extended, extended.causes.size() - 1, Index(k), false));
    }
  }

  const auto simulated = [&](std::size_t from, std::size_t to, std::vector<State> states,
                             Study::Wanted wanted) {
    for (std::size_t i = from; i < to; ++i) {
      const Difference& d = differences[i];
      if (d.observed) continue;
      if (d.above) states.push_back(*d.above);
      if (d.below) states.push_back(*d.below);
    }
    return study.motions(states, wanted);
  };
  auto runs = simulated(0, of_state, {state}, options.wanted);
  if (!runs[0]) {
    throw_compute("The fitted model itself could not be simulated. Fit it again first.");
  }
  std::ranges::move(simulated(of_state, differences.size(), {}, Study::Wanted::kUsed),
                    std::back_inserter(runs));
  Linearised result;
  result.prediction = study.seen(*runs[0], state);
  std::size_t next = 1;
  std::vector<std::optional<VectorXd>> slopes;
  slopes.reserve(differences.size());
  for (const Difference& d : differences) {
    const auto side = [&](const std::optional<State>& there) -> std::optional<VectorXd> {
      if (!there) return std::nullopt;
      const std::optional<Motion>& run = d.observed ? runs[0] : runs[next++];
      return run ? std::optional<VectorXd>(study.seen(*run, *there)) : std::nullopt;
    };
    const auto above = side(d.above);
    const auto below = side(d.below);
    if (above && below) {
      slopes.emplace_back((*above - *below) / (d.up + d.down));
    } else if (above) {
      slopes.emplace_back((*above - result.prediction) / d.up);
    } else if (below) {
      slopes.emplace_back((result.prediction - *below) / d.down);
    } else {
      slopes.emplace_back(std::nullopt);
    }
  }
  result.theta = MatrixXd::Zero(study.size(), state.theta.size());
  for (Index p = 0; p < state.theta.size(); ++p) {
    if (slopes[std::size_t(p)]) result.theta.col(p) = *slopes[std::size_t(p)];
  }
  std::size_t at = std::size_t(state.theta.size());
  const auto take = [&](Index count) {
    MatrixXd columns = MatrixXd::Zero(study.size(), count);
    bool all = true;
    for (Index k = 0; k < count; ++k, ++at) {
      if (slopes[at]) columns.col(k) = *slopes[at];
      all = all && slopes[at].has_value();
    }
    return std::pair(std::move(columns), all);
  };
  Index active = 0;
  for (const Active& cause : state.causes) active += cause.values.size();
  result.active = take(active).first;
  for (const Candidate& candidate : candidates) {
    const Effect& effect = model.effects()[std::size_t(candidate.effect)];
    const auto count = Index(std::min(effect.numbers.size(), options.numbers));
    auto [columns, all] = take(count);
    result.columns.push_back({candidate, all ? std::move(columns) : MatrixXd(study.size(), 0)});
  }
  return result;
}

Linearised linearise_keeping(const Study& study, const State& state,
                             const std::vector<Candidate>& candidates, DifferenceOptions options,
                             const MatrixXd& known) {
  if (known.cols() == 0) return linearise(study, state, candidates, options);
  options.left_out = nuisances_of_times(study.model());
  Linearised result = linearise(study, state, candidates, options);
  result.theta(Eigen::all, options.left_out) = known(Eigen::all, options.left_out);
  return result;
}

void hold_corrections(const Model& model, const State& state, VectorXd& prediction,
                      MatrixXd& theta) {
  for (const Index p : model.corrections()) {
    prediction -= state.theta[p] / model.parameters()[std::size_t(p)].scale * theta.col(p);
    theta.col(p).setZero();
  }
}

}  // namespace matterfit::diagnose
