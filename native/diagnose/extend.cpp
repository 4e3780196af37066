// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/extend.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "diagnose/onset.hpp"
#include "fit/numerics/student.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Rivals within a fifth of the best score are refitted too: far from neutral a first estimate is
/// not that exact.
constexpr double kNearScore = 0.8;
/// Refitted whatever their scores say of them, for the same reason.
constexpr std::size_t kAlways = 3;
/// Of the further causes that are tried beside those that are there.
constexpr std::size_t kFurther = 3;
/// The smallest deviation that counts as noise: rounding of single precision at a metre.
constexpr double kNoiseFloor = 1e-7;
/// χ² is counted in numbers of causes at this price each.
constexpr double kPrice = 2.0;
/// The solver's error is extrapolated to first order: a tenth of the χ² it stands for, a third of
/// its size, may be the next order's.
constexpr double kExtrapolated = 0.1;
/// χ²/dof from which the best model counts as inadequate: its errors are then not noise.
constexpr double kInadequate = 1.5;
/// Standard errors by which blocks must agree: 100 : 1, one-sided.
constexpr double kAgreement = 2.33;
/// A cause that is itself an acceleration field predicts what the free field does, to rounding.
constexpr double kAsGood = 1.02;

MatrixXd both(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd result(a.rows(), a.cols() + b.cols());
  result << a, b;
  return result;
}

/// The effect's shape with the best score, for each effect; best first, observable ones.
std::vector<std::size_t> best_shapes(const std::vector<Score>& scores) {
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < scores.size(); ++k) {
    if (scores[k].observable) order.push_back(k);
  }
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    return scores[a].equivalent > scores[b].equivalent;
  });
  std::vector<std::size_t> result;
  for (const std::size_t k : order) {
    const bool seen = std::ranges::any_of(result, [&](std::size_t other) {
      return scores[other].candidate.effect == scores[k].candidate.effect;
    });
    if (!seen) result.push_back(k);
  }
  return result;
}

const MatrixXd& columns_of(const Linearised& slopes, const Candidate& candidate) {
  const auto found = std::ranges::find_if(slopes.columns, [&](const Linearised::Column& column) {
    return column.candidate.effect == candidate.effect &&
           column.candidate.variant == candidate.variant;
  });
  return found->values;
}

/// A state with one more cause, by a share of its first estimate (in scales).
State extended(const Model& model, const State& state, const Candidate& candidate,
               const VectorXd& estimate, double share) {
  State result = state;
  const Effect& effect = model.effects()[std::size_t(candidate.effect)];
  Active cause{candidate.effect, candidate.variant, VectorXd(estimate.size())};
  for (Index k = 0; k < estimate.size(); ++k) {
    const Number& number = effect.numbers[std::size_t(k)];
    cause.values[k] =
        std::clamp(number.neutral + share * estimate[k] * number.scale, number.low, number.high);
  }
  result.causes.push_back(std::move(cause));
  return result;
}

class Search {
 public:
  Search(const Study& study, int members, const ExtendOptions& options)
      : study_(study), members_(members), options_(options) {}

  Extension run() {
    linearise_base(study_.fitted());
    estimate_from(study_.measured() - out_.slopes.prediction);
    fit_base();
    try_singles();
    // What no longer counts as discrepancy may have counted as noise, and the other way round.
    if (!out_.singles.empty()) {
      const Noise before = out_.noise;
      estimate_from(study_.measured() - out_.singles.front().refit.prediction);
      if (changed(before, out_.noise)) {
        fit_base();
        try_singles();
      }
    }
    choose();
    further();
    accept();
    return std::move(out_);
  }

 private:
  void tell(double fraction, const std::string& what) const {
    if (options_.progress) options_.progress(fraction, what);
  }

  void linearise_base(const State& state) {
    tell(0.0, "Differentiating all causes");
    study_.begin("derivatives");
    base_state_ = state;
    out_.slopes =
        linearise(study_, state, candidates_of(study_.model(), state), options_.refit.differences);
    // The solver's own error is not another one a little beside.
    if (out_.spread.members.rows() > 0) return;
    tell(0.2, "Measuring the solver's own error");
    study_.begin("solver");
    out_.spread = numerical_spread(study_, state, {.members = members_});
  }

  void estimate_from(const VectorXd& stacked) {
    out_.noise =
        estimate_noise(study_.used(), study_.model().captures(), stacked.head(study_.used().size()),
                       explained_columns(study_, out_.slopes, out_.spread), kNoiseFloor,
                       body_turns(study_.used(), study_.model().captures(),
                                  out_.slopes.prediction.head(study_.used().size())));
  }

  static bool changed(const Noise& a, const Noise& b) {
    for (std::size_t c = 0; c < a.captures.size(); ++c) {
      const TrackNoise& x = a.captures[c];
      const TrackNoise& y = b.captures[c];
      // A tenth in size or in correlation shifts thresholds by as much.
      if (std::abs(std::log(x.sigma / y.sigma)) > 0.1 ||
          std::abs(x.correlation - y.correlation) > 0.1 ||
          std::abs(x.common_sigma - y.common_sigma) > 0.1 * (x.sigma + y.sigma) ||
          std::abs(x.place_sigma - y.place_sigma) > 0.1 * (x.sigma + y.sigma)) {
        return true;
      }
    }
    return false;
  }

  void fit_base() {
    tell(0.4, "Refitting");
    study_.begin("refits");
    refitter_.emplace(study_, out_.noise, out_.spread, options_.refit);
    out_.base = Trial{};
    out_.base.refit = refitter_->fit({{base_state_}, out_.slopes.theta});
    const VectorXd first = refitter_->whitening().apply(
        (study_.measured() - out_.slopes.prediction).head(study_.used().size()));
    // The fit ended elsewhere under its own weights: derivatives are taken anew where that matters.
    if (first.squaredNorm() - out_.base.refit.chi_square >
        5.0 + 0.02 * out_.base.refit.chi_square) {
      linearise_base(out_.base.refit.state);
      estimate_from(study_.measured() - out_.base.refit.prediction);
      study_.begin("refits");
      refitter_.emplace(study_, out_.noise, out_.spread, options_.refit);
      out_.base.refit = refitter_->fit({{base_state_}, out_.slopes.theta});
    }
    judge_.emplace(study_, out_.noise, out_.spread, out_.slopes.theta, options_.refit);
    study_.begin("held-out");
    const Refit* const base = &out_.base.refit;
    out_.base.opinion = std::move(judge_->judge({&base, 1}).front());
    weigh(out_.base);
    tell(0.45, "Scoring all causes");
    out_.first = analyse(study_, base_state_, out_.slopes, out_.spread, out_.noise,
                         out_.slopes.prediction, 0.0, options_.analysis);
    if (members_ > 0 && study_.model().has_numerics()) {
      const Spread none = Spread::none(study_.size());
      const Analysis exact = analyse(study_, base_state_, out_.slopes, none, out_.noise,
                                     out_.slopes.prediction, 0.0, options_.analysis);
      double largest = 0.0;
      for (const Score& score : exact.scores) largest = std::max(largest, score.equivalent);
      const Refitter without(study_, out_.noise, none, options_.refit);
      study_.begin("refits");
      const Refit exact_fit = without.fit({{out_.base.refit.state}, out_.base.refit.slopes});
      out_.solver_took = std::max(0.0, exact_fit.deviance - out_.base.refit.deviance);
      out_.exact_solver_significant = exact.smooth.p < 0.01 || exact.placebo.p(largest) < 0.01;
    }
  }

  struct Attempt {
    std::vector<Candidate> causes;
    RefitStart start;
  };

  /// Those that can be simulated, in order, refitted side by side.
  [[nodiscard]] std::vector<Trial> tried(std::vector<Attempt> attempts,
                                         const std::string& stage) const {
    study_.begin(stage);
    std::vector<RefitStart> starts;
    starts.reserve(attempts.size());
    for (Attempt& attempt : attempts) starts.push_back(std::move(attempt.start));
    std::vector<std::optional<Refit>> refits = refitter_->fit_all(std::move(starts));
    std::vector<Trial> trials;
    trials.reserve(attempts.size());
    for (std::size_t i = 0; i < attempts.size(); ++i) {
      if (!refits[i]) continue;
      Trial& trial = trials.emplace_back();
      trial.causes = std::move(attempts[i].causes);
      trial.refit = std::move(*refits[i]);
      for (const Candidate& candidate : trial.causes) {
        trial.numbers +=
            int(study_.model().effects()[std::size_t(candidate.effect)].numbers.size());
      }
    }
    std::vector<const Refit*> models;
    models.reserve(trials.size());
    for (const Trial& trial : trials) models.push_back(&trial.refit);
    study_.begin("held-out");
    std::vector<Judge::Opinion> opinions = judge_->judge(models);
    for (std::size_t i = 0; i < trials.size(); ++i) {
      trials[i].opinion = std::move(opinions[i]);
      weigh(trials[i]);
    }
    return trials;
  }

  void weigh(Trial& trial) const {
    trial.evidence = trial.refit.deviance + trial.opinion.deviance + kPrice * trial.numbers;
    const VectorXd white = refitter_->whitening().apply(
        (study_.measured() - trial.refit.prediction).head(study_.used().size()));
    trial.blocks = trial.opinion.blocks;
    add_by_block(study_.used(), study_.model().captures(), white, trial.blocks);
  }

  /// Whether `worse` is excluded by `good`: 100 : 1 in likelihood, and where even the good model
  /// leaves more than noise, so that likelihoods under that noise mean little, blocks must agree as
  /// well: the mean of ln(χ²_worse/χ²_good) over blocks, each with an error of its own size,
  /// against its spread (after Vuong 1989).
  [[nodiscard]] static bool excludes(const Trial& good, const Trial& worse) {
    const double looseness = looseness_of(good.refit);
    if (worse.evidence - good.evidence < kExcluded * looseness) return false;
    if (looseness < kInadequate) return true;
    const double count = double(good.blocks.size());
    std::vector<double> ratios;
    ratios.reserve(good.blocks.size());
    double mean = 0.0;
    for (const auto& [key, sum] : good.blocks) {
      const auto other = worse.blocks.find(key);
      if (other == worse.blocks.end()) continue;
      ratios.push_back(std::log((other->second + 1.0) / (sum + 1.0)));
      mean += ratios.back() / count;
    }
    double variance = 0.0;
    for (const double ratio : ratios) {
      variance += (ratio - mean) * (ratio - mean) / std::max(1.0, count - 1.0);
    }
    // Few blocks know their own spread badly: Student's quantile in proportion.
    const double wider = fit::student_quantile(std::max(1.0, count - 1.0)) / fit::kNormalQuantile;
    return mean > kAgreement * wider * std::sqrt(variance / count);
  }

  void try_singles() {
    // Where a refit of the pass before ended is the better start.
    std::vector<Trial> known = std::move(out_.singles);
    out_.singles.clear();
    const std::vector<Score>& scores = out_.first->scores;
    const std::vector<std::size_t> order = best_shapes(scores);
    if (order.empty()) return;
    const Score& top = scores[order.front()];
    std::vector<Attempt> attempts;
    add_onsets(scores, known, attempts);
    for (const std::size_t k : order) {
      if (int(attempts.size()) >= options_.refits) break;
      const Score& score = scores[k];
      if (!effect_of(score).onsets.empty()) continue;
      if (out_.first->placebo.p(score.equivalent) >= options_.analysis.placebo.level) break;
      const double imitates = out_.first->test.imitation(order.front(), top.estimate, k);
      const bool like = top.statistic * (1.0 - imitates) < kExcluded ||
                        score.statistic > kNearScore * top.statistic;
      if (!like && attempts.size() >= kAlways) continue;
      attempts.push_back({{score.candidate}, single_start(score, known)});
    }
    if (attempts.empty()) return;
    tell(0.5, fmt::format("Refitting with {} causes", attempts.size()));
    out_.singles = tried(std::move(attempts), "refits");
    std::ranges::stable_sort(out_.singles, {}, &Trial::evidence);
  }

  [[nodiscard]] const Effect& effect_of(const Score& score) const {
    return study_.model().effects()[std::size_t(score.candidate.effect)];
  }

  /// Adds causes that set in at some time, in every shape and whatever their scores: the base,
  /// which averages over before and after, may not even come near what was run into.
  void add_onsets(const std::vector<Score>& scores, std::vector<Trial>& known,
                  std::vector<Attempt>& attempts) {
    for (const Score& score : scores) {
      const std::vector<double>& onsets = effect_of(score).onsets;
      if (onsets.empty()) continue;
      const double onset = onsets[std::size_t(score.candidate.variant)];
      const auto [at, fresh] = before_onset_.try_emplace(onset);
      if (fresh) {
        study_.begin("refits");
        at->second = fitted_before(study_, out_.noise, out_.spread, base_state_, out_.slopes.theta,
                                   onset, options_.refit);
      }
      attempts.push_back(
          {{score.candidate},
           at->second ? onset_start(score, *at->second) : single_start(score, known)});
    }
  }

  /// At its whole first step from `before`. Slopes that are there are of another motion, and after
  /// an impact no line holds for long.
  [[nodiscard]] RefitStart onset_start(const Score& score, const State& before) const {
    const std::vector<Number>& numbers = effect_of(score).numbers;
    VectorXd whole(Index(numbers.size()));
    for (std::size_t k = 0; k < numbers.size(); ++k) {
      whole[Index(k)] = numbers[k].first_step / numbers[k].scale;
    }
    return {{extended(study_.model(), before, score.candidate, whole, 1.0)}, {}, 3};
  }

  [[nodiscard]] RefitStart single_start(const Score& score, std::vector<Trial>& known) const {
    for (Trial& trial : known) {
      if (trial.causes.front().effect == score.candidate.effect &&
          trial.causes.front().variant == score.candidate.variant) {
        return {{trial.refit.state}, std::move(trial.refit.slopes)};
      }
    }
    return {{extended(study_.model(), base_state_, score.candidate, score.estimate, 1.0),
             extended(study_.model(), base_state_, score.candidate, score.estimate, 0.5)},
            both(out_.slopes.theta, columns_of(out_.slopes, score.candidate))};
  }

  static double looseness_of(const Refit& refit) {
    return std::max(1.0, refit.chi_square / refit.freedom);
  }

  void choose() {
    if (out_.singles.empty()) return;
    out_.best = out_.singles.front();
    out_.looseness = looseness_of(out_.best->refit);
  }

  /// What is left beside `trial`: first with the derivatives that are there, which cost nothing;
  /// where those see something, with new ones. `slopes` are those that were used.
  [[nodiscard]] Analysis analyse_at(const Trial& trial, Linearised& slopes) const {
    const auto analysed = [&] {
      return analyse(study_, trial.refit.state, slopes, out_.spread, out_.noise,
                     trial.refit.prediction, trial.refit.bias, options_.analysis);
    };
    const Index p = trial.refit.state.theta.size();
    slopes.prediction = trial.refit.prediction;
    slopes.theta = trial.refit.slopes.leftCols(p);
    slopes.active = trial.refit.slopes.rightCols(trial.refit.slopes.cols() - p);
    slopes.columns.clear();
    for (const Linearised::Column& column : out_.slopes.columns) {
      const bool active = std::ranges::any_of(trial.causes, [&](const Candidate& cause) {
        return cause.effect == column.candidate.effect;
      });
      if (!active) slopes.columns.push_back(column);
    }
    Analysis found = analysed();
    if (!further_seen(found)) return found;
    study_.begin("further derivatives");
    slopes = linearise(study_, trial.refit.state, candidates_of(study_.model(), trial.refit.state),
                       options_.refit.differences);
    return analysed();
  }

  [[nodiscard]] bool further_seen(const Analysis& analysis) const {
    const std::vector<std::size_t> order = best_shapes(analysis.scores);
    return !order.empty() &&
           analysis.placebo.p(analysis.scores[order.front()].equivalent) < options_.further_level;
  }

  /// Whether `more` is worth its causes over `fewer`.
  [[nodiscard]] bool better(const Trial& fewer, const Trial& more) const {
    if (!excludes(more, fewer)) return false;
    const double before = root_mean_square(judge_->rows(), fewer.opinion.residual);
    const double after = root_mean_square(judge_->rows(), more.opinion.residual);
    // Unseen samples may not get worse by more than a hundredth.
    return after <= 1.01 * before;
  }

  /// Whether what was kept back is predicted as well as noise and solver let it be: a further cause
  /// could show itself nowhere.
  [[nodiscard]] bool predicts_to_the_floor(const Trial& trial) const {
    const Gain g = judge_->gain_of(trial.opinion, trial.opinion, trial.numbers, options_.gain);
    return judge_->rows().size() > 0 && !g.measurable;
  }

  void further() {
    if (!out_.best) return;
    Linearised slopes;
    out_.last = analyse_at(*out_.best, slopes);
    while (int(out_.best->causes.size()) < options_.most_causes) {
      if (!further_seen(*out_.last) || predicts_to_the_floor(*out_.best)) return;
      tell(0.85, "Looking for a further cause");
      const std::vector<std::size_t> order = best_shapes(out_.last->scores);
      std::vector<Attempt> attempts;
      for (std::size_t i = 0; i < std::min(kFurther, order.size()); ++i) {
        const Score& score = out_.last->scores[order[i]];
        std::vector<Candidate> causes = out_.best->causes;
        causes.push_back(score.candidate);
        const State& state = out_.best->refit.state;
        attempts.push_back(
            {std::move(causes),
             {{extended(study_.model(), state, score.candidate, score.estimate, 1.0),
               extended(study_.model(), state, score.candidate, score.estimate, 0.5)},
              both(both(slopes.theta, slopes.active), columns_of(slopes, score.candidate))}});
      }
      if (out_.best->causes.size() == 1) add_pairs(attempts);
      std::optional<Trial> next;
      for (Trial& trial : tried(std::move(attempts), "further refits")) {
        if (!next || trial.evidence < next->evidence) next = std::move(trial);
      }
      if (!next || !better(*out_.best, *next)) return;
      eliminate(*next);
      if (next->causes.size() <= out_.best->causes.size() &&
          next->evidence >= out_.best->evidence) {
        return;
      }
      out_.best = std::move(*next);
      out_.looseness = looseness_of(out_.best->refit);
      out_.last = analyse_at(*out_.best, slopes);
    }
  }

  /// All pairs of the best eight by their joint score; the best two are refitted.
  void add_pairs(std::vector<Attempt>& attempts) const {
    std::vector<std::size_t> order = best_shapes(out_.first->scores);
    if (order.size() > 8) order.resize(8);
    struct Found {
      double statistic;
      std::size_t k;
      std::size_t l;
    };
    std::vector<Found> pairs;
    for (std::size_t i = 0; i < order.size(); ++i) {
      for (std::size_t j = i + 1; j < order.size(); ++j) {
        pairs.push_back(
            {out_.first->test.pair(out_.first->numerators, order[i], order[j]).statistic, order[i],
             order[j]});
      }
    }
    std::ranges::stable_sort(
        pairs, [](const Found& a, const Found& b) { return a.statistic > b.statistic; });
    if (pairs.size() > 2) pairs.resize(2);
    for (const Found& found : pairs) {
      const auto estimate = out_.first->test.pair(out_.first->numerators, found.k, found.l);
      const Candidate a = out_.first->scores[found.k].candidate;
      const Candidate b = out_.first->scores[found.l].candidate;
      const State one = extended(study_.model(), base_state_, a, estimate.first, 1.0);
      const State half = extended(study_.model(), base_state_, a, estimate.first, 0.5);
      attempts.push_back({{a, b},
                          {{extended(study_.model(), one, b, estimate.second, 1.0),
                            extended(study_.model(), half, b, estimate.second, 0.5)},
                           both(both(out_.slopes.theta, columns_of(out_.slopes, a)),
                                columns_of(out_.slopes, b))}});
    }
  }

  /// Takes out causes without which the model is as good.
  void eliminate(Trial& trial) {
    for (std::size_t c = 0; c < trial.causes.size() && trial.causes.size() > 1;) {
      std::optional<Trial> fewer = without(trial, c);
      if (!fewer || better(*fewer, trial)) {
        ++c;
      } else {
        trial = std::move(*fewer);
        c = 0;
      }
    }
  }

  [[nodiscard]] std::optional<Trial> without(const Trial& trial, std::size_t c) const {
    Attempt attempt{trial.causes, {{trial.refit.state}, {}}};
    State& state = attempt.start.states.front();
    Index first = state.theta.size();
    for (std::size_t before = 0; before < c; ++before) first += state.causes[before].values.size();
    const Index count = state.causes[c].values.size();
    const MatrixXd& slopes = trial.refit.slopes;
    attempt.start.slopes =
        both(slopes.leftCols(first), slopes.rightCols(slopes.cols() - first - count));
    state.causes.erase(state.causes.begin() + std::ptrdiff_t(c));
    attempt.causes.erase(attempt.causes.begin() + std::ptrdiff_t(c));
    std::vector<Attempt> attempts;
    attempts.push_back(std::move(attempt));
    std::vector<Trial> trials = tried(std::move(attempts), "further refits");
    if (trials.empty()) return std::nullopt;
    return std::move(trials.front());
  }

  void accept() {
    for (Trial& trial : out_.singles) {
      trial.gain = judge_->gain_of(out_.base.opinion, trial.opinion, trial.numbers, options_.gain);
    }
    out_.base.gain = judge_->gain_of(out_.base.opinion, out_.base.opinion, 1, options_.gain);
    if (!out_.best) return;
    out_.best->gain =
        judge_->gain_of(out_.base.opinion, out_.best->opinion, out_.best->numbers, options_.gain);
    const Gain& g = out_.best->gain;
    // Below the floor distances say nothing, but likelihoods of what was kept back do.
    const double kept_back = out_.base.opinion.deviance;
    const bool predicts =
        g.measurable ? g.low > 0.0 && g.after < g.last_residual && g.after <= kAsGood * g.free_field
        : kept_back > 0.0 ? kept_back - out_.best->opinion.deviance > kPrice * out_.best->numbers
                          : g.after <= 1.05 * g.before;
    const bool likelier = out_.base.evidence - out_.best->evidence > kExcluded * out_.looseness;
    // An error that is beyond what solver and noise make, and that the cause takes away, is not the
    // solver's.
    out_.within_solver =
        out_.exact_solver_significant && !(g.measurable && predicts) &&
        out_.base.evidence - out_.best->evidence < kExtrapolated * out_.solver_took;
    out_.accepted = predicts && likelier && !out_.best->refit.at_bound && !out_.within_solver;
    for (std::size_t k = 0; k < out_.first->scores.size(); ++k) {
      if (is_rival(out_.first->scores[k])) out_.rivals.push_back(k);
    }
  }

  /// Whether the best single cause does not exclude this candidate.
  [[nodiscard]] bool is_rival(const Score& score) const {
    if (!score.observable) return false;
    const Trial& best = out_.singles.front();
    const double limit = kExcluded * looseness_of(best.refit);
    for (const Trial& trial : out_.singles) {
      if (trial.causes.front().effect != score.candidate.effect) continue;
      return trial.causes.front().variant == score.candidate.variant && !trial.refit.at_bound &&
             !excludes(best, trial);
    }
    // Not refitted: by what the linear theory promises it at most, on the samples fitted to.
    const bool best_shape = std::ranges::none_of(out_.first->scores, [&](const Score& other) {
      return other.candidate.effect == score.candidate.effect &&
             other.equivalent > score.equivalent;
    });
    const double promised = out_.base.refit.deviance - score.statistic + kPrice * score.freedom;
    return best_shape && promised - best.refit.deviance - kPrice * best.numbers < limit;
  }

  const Study& study_;
  int members_;
  const ExtendOptions& options_;
  State base_state_;
  std::map<double, std::optional<State>> before_onset_;  ///< by the time
  Extension out_;
  std::optional<Refitter> refitter_;
  std::optional<Judge> judge_;
};

}  // namespace

Extension extend(const Study& study, int members, const ExtendOptions& options) {
  return Search(study, members, options).run();
}

}  // namespace matterfit::diagnose
