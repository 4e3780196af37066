// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/study.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <set>
#include <utility>

#include "base/error.hpp"
#include "diagnose/observe.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Point point_of(const Model& model, const State& state, const Numerics& numerics) {
  Point point{state.theta, {}, numerics};
  for (const Active& cause : state.causes) {
    const Effect& effect = model.effects()[std::size_t(cause.effect)];
    if (effect.observation != Observation::kNone) continue;
    point.causes.push_back({cause.effect, cause.variant, cause.values});
  }
  return point;
}

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

/// Standard deviations of Numerics::lumping_slope and lumping_bend: those of five to seven linear
/// elements across a body, whose pattern is nearly, but not quite, symmetric.
constexpr double kLumpingSlope = 0.02;
constexpr double kLumpingBend = 0.08;

/// Runs that lump masses by one standard deviation otherwise, one for each way.
std::vector<Numerics> ways_to_lump() {
  std::vector<Numerics> result;
  for (Index a = 0; a < 3; ++a) result.emplace_back().lumping_slope[a] = kLumpingSlope;
  for (std::size_t b = 0; b < Numerics{}.lumping_bend.size(); ++b) {
    result.emplace_back().lumping_bend[b] = kLumpingBend;
  }
  return result;
}

/// Deviations of the runs from..to that ended, rows × runs.
MatrixXd deviations(const std::vector<std::optional<VectorXd>>& runs, std::size_t from,
                    std::size_t to) {
  std::vector<std::size_t> done;
  for (std::size_t i = from; i < to; ++i) {
    if (runs[i]) done.push_back(i);
  }
  MatrixXd result(runs[0]->size(), Index(done.size()));
  for (std::size_t k = 0; k < done.size(); ++k) result.col(Index(k)) = *runs[done[k]] - *runs[0];
  return result;
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

/// Of number k of the cause `c` of a state that has it.
Difference cause_difference(const Model& model, const State& state, std::size_t c, Index k,
                            bool central) {
  const Active& cause = state.causes[c];
  const Number& number = model.effects()[std::size_t(cause.effect)].numbers[std::size_t(k)];
  const bool first = cause.values[k] == number.neutral && number.first_step > 0.0;
  const double step = first ? number.first_step : 1e-2 * number.scale;
  const double low = number.one_sided ? number.neutral : number.low;
  Difference result;
  result.observed = is_observation(model, cause.effect);
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

void Study::begin(const std::string& stage) const {
  std::vector<Ledger::Stage>& stages = ledger_->stages;
  if (stages.size() == 1 && stages.front().runs == 0) stages.front().name = stage;
  const auto found =
      std::ranges::find_if(stages, [&](const Ledger::Stage& s) { return s.name == stage; });
  ledger_->current = std::size_t(found - stages.begin());
  if (found == stages.end()) stages.push_back({stage, 0});
}

int Study::runs() const {
  int sum = 0;
  for (const Ledger::Stage& stage : ledger_->stages) sum += stage.runs;
  return sum;
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
                                                  const Numerics& numerics) const {
  std::vector<Point> points;
  points.reserve(states.size());
  for (const State& state : states) points.push_back(point_of(*model_, state, numerics));
  ledger_->stages[ledger_->current].runs += int(points.size());
  return model_->simulate(points);
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
                                                    const Numerics& numerics) const {
  const auto runs = motions(states, numerics);
  std::vector<std::optional<VectorXd>> result(states.size());
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (runs[i]) result[i] = seen(*runs[i], states[i]);
  }
  return result;
}

std::vector<std::optional<VectorXd>> Study::predict_variants(
    const State& state, const std::vector<Numerics>& variants) const {
  std::vector<Point> points;
  points.reserve(variants.size());
  for (const Numerics& numerics : variants) points.push_back(point_of(*model_, state, numerics));
  ledger_->stages[ledger_->current].runs += int(points.size());
  const auto runs = model_->simulate(points);
  std::vector<std::optional<VectorXd>> result(variants.size());
  for (std::size_t i = 0; i < variants.size(); ++i) {
    if (runs[i]) result[i] = seen(*runs[i], state);
  }
  return result;
}

std::vector<Candidate> candidates_of(const Model& model, const State& state) {
  std::vector<Candidate> result;
  for (std::size_t e = 0; e < model.effects().size(); ++e) {
    const bool active = std::ranges::any_of(
        state.causes, [&](const Active& cause) { return cause.effect == int(e); });
    if (active) continue;
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
    differences.push_back(theta_difference(model, state, p, options));
  }
  for (std::size_t c = 0; c < state.causes.size(); ++c) {
    for (Index k = 0; k < state.causes[c].values.size(); ++k) {
      differences.push_back(cause_difference(model, state, c, k, options.central));
    }
  }
  for (const Candidate& candidate : candidates) {
    const Effect& effect = model.effects()[std::size_t(candidate.effect)];
    State extended = state;
    extended.causes.push_back({candidate.effect, candidate.variant, neutral_values(effect)});
    for (std::size_t k = 0; k < effect.numbers.size(); ++k) {
      differences.push_back(
          cause_difference(model, extended, extended.causes.size() - 1, Index(k), false));
    }
  }

  std::vector<State> states{state};
  states.reserve(1 + 2 * differences.size());
  for (const Difference& d : differences) {
    if (d.observed) continue;
    if (d.above) states.push_back(*d.above);
    if (d.below) states.push_back(*d.below);
  }
  const auto runs = study.motions(states);
  if (!runs[0]) {
    throw_compute("The fitted model itself could not be simulated. Fit it again first.");
  }
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
  std::size_t at = 0;
  const auto take = [&](Index count) {
    MatrixXd columns = MatrixXd::Zero(study.size(), count);
    bool all = true;
    for (Index k = 0; k < count; ++k, ++at) {
      if (slopes[at]) columns.col(k) = *slopes[at];
      all = all && slopes[at].has_value();
    }
    return std::pair(std::move(columns), all);
  };
  result.theta = take(state.theta.size()).first;
  Index active = 0;
  for (const Active& cause : state.causes) active += cause.values.size();
  result.active = take(active).first;
  for (const Candidate& candidate : candidates) {
    const Index count = Index(model.effects()[std::size_t(candidate.effect)].numbers.size());
    auto [columns, all] = take(count);
    result.columns.push_back({candidate, all ? std::move(columns) : MatrixXd(study.size(), 0)});
  }
  return result;
}

Spread Spread::none(Index rows) { return {MatrixXd(rows, 0), MatrixXd(rows, 0), {}}; }

Spread Spread::at(const std::vector<Index>& places) const {
  Spread result{members(places, Eigen::all), lumping(places, Eigen::all), {}};
  if (bias.size() > 0) result.bias = bias(places);
  return result;
}

Spread Spread::top(Index rows) const {
  Spread result{members.topRows(rows), lumping.topRows(rows), {}};
  if (bias.size() > 0) result.bias = bias.head(rows);
  return result;
}

Spread Spread::bottom(Index rows) const {
  Spread result{members.bottomRows(rows), lumping.bottomRows(rows), {}};
  if (bias.size() > 0) result.bias = bias.tail(rows);
  return result;
}

MatrixXd Spread::deviations() const {
  MatrixXd result(members.rows(), members.cols() + lumping.cols());
  result << members / std::sqrt(std::max(1.0, double(members.cols()))), lumping;
  return result;
}

Spread numerical_spread(const Study& study, const State& state, const SpreadRuns& which) {
  Spread spread = Spread::none(study.size());
  if (!study.model().has_numerics() || which.members <= 0) return spread;
  constexpr double kRatio = 1.26;  // 2^(1/3): twice the cells
  std::vector<Numerics> variants(3);
  variants[1].spacing = 1.0 / kRatio;
  variants[2].spacing = kRatio;
  for (int m = 1; m <= which.members; ++m) {
    // The additive recurrence of the plastic number and its powers: evenly spread in four
    // dimensions for any count (Roberts 2018; root of x⁵ = x + 1).
    constexpr double kRoot = 1.1673039782614187;
    const auto part = [&](int power) {
      const double x = 0.5 + m / std::pow(kRoot, power);
      return x - std::floor(x);
    };
    Numerics numerics;
    numerics.spacing = 0.85 * std::pow(kRatio / 0.85, part(1));
    numerics.offset = Vec3d(part(2), part(3), part(4));
    numerics.step = m % 4 == 0 ? 0.5 : 1.0;  // half of dt costs twice the time
    numerics.seed = m;
    variants.push_back(numerics);
  }
  const std::size_t sampled = variants.size();
  if (which.lumping) std::ranges::copy(ways_to_lump(), std::back_inserter(variants));
  const auto runs = study.predict_variants(state, variants);
  if (!runs[0]) return spread;
  if (runs[1] && runs[2]) spread.bias = (*runs[2] - *runs[1]) / (kRatio - 1.0 / kRatio);
  spread.members = deviations(runs, 3, sampled);
  spread.lumping = deviations(runs, sampled, runs.size());
  return spread;
}

SolverColumns solver_columns(const Rows& rows, const std::vector<Capture>& captures,
                             const Spread& spread) {
  constexpr double kOwnPattern = 0.5;
  // Weights of 1, cos πu, … with u the time in the clip; the mean square of a cosine is a half.
  constexpr std::array<double, 4> kTimes = {0.4, 0.6, 0.4, 0.2};
  // Of 1 and of each coordinate over the body's size, whose mean square is about a fifth.
  constexpr std::array<double, 4> kPlaces = {0.5, 0.8, 0.8, 0.8};
  SolverColumns result;
  const MatrixXd& members = spread.members;
  const Index count = members.cols();
  const Index modes = Index(kTimes.size() * kPlaces.size());
  MatrixXd patterns(rows.size(), modes);
  for (const Series& series : rows.series()) {
    const Capture& capture = captures[std::size_t(series.capture)];
    Vec3d centre = Vec3d::Zero();
    for (const Vec3d& x : capture.rest) centre += x / double(capture.tracks());
    double size = 1e-12;
    for (const Vec3d& x : capture.rest) size = std::max(size, (x - centre).norm());
    const Vec3d x = (capture.rest[std::size_t(series.track)] - centre) / size;
    const double span = std::max(capture.times.back() - capture.times.front(), 1e-12);
    for (Index i = series.begin; i < series.end; ++i) {
      const double u = (rows.time(i) - capture.times.front()) / span;
      for (std::size_t t = 0; t < kTimes.size(); ++t) {
        const double time = std::sqrt(kTimes[t]) * std::cos(std::numbers::pi * double(t) * u);
        for (std::size_t p = 0; p < kPlaces.size(); ++p) {
          const double place = std::sqrt(kPlaces[p]) * (p == 0 ? 1.0 : x[Index(p) - 1]);
          patterns(i, Index(t * kPlaces.size() + p)) = time * place;
        }
      }
    }
  }
  const double share = 1.0 / std::sqrt(std::max(1.0, double(count)));
  const double first = std::sqrt(1.0 - kOwnPattern + kOwnPattern * kTimes[0] * kPlaces[0]);
  result.values.resize(rows.size(), count * modes + spread.lumping.cols());
  result.values.rightCols(spread.lumping.cols()) = spread.lumping;
  result.member.reserve(std::size_t(result.values.cols()));
  for (Index m = 0; m < count; ++m) {
    for (Index k = 0; k < modes; ++k) {
      auto column = result.values.col(m * modes + k);
      if (k == 0) {
        column = share * first * members.col(m);
      } else {
        column = share * std::sqrt(kOwnPattern) * members.col(m).cwiseProduct(patterns.col(k));
      }
      result.member.push_back(int(m));
    }
  }
  result.member.resize(std::size_t(result.values.cols()), -1);
  return result;
}

}  // namespace matterfit::diagnose
