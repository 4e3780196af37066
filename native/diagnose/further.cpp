// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/further.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <utility>

#include "diagnose/starts.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// How many further causes are tried beside those that are there.
constexpr std::size_t kFurther = 3;
/// Least size at which a cause that another one stands beside begins, in scales.
constexpr double kStandsOn = 4.0;
/// Causes of which pairs are made.
constexpr std::size_t kOfPairs = 8;
/// Share of the excess that a runner-up explains, beside which others are sought too.
constexpr double kMost = 0.5;

class Further {
 public:
  Further(const Study& study, const Trials& trials, const Judge& judge,
          const ExtendOptions& options, Extension& out)
      : study_(study), trials_(trials), judge_(judge), options_(options), out_(out) {}

  void run() {
    Linearised slopes;
    grow(slopes);
    if (out_.best->causes.size() > 1 && !trials_.cut()) exchange(slopes);
  }

 private:
  /// Adds causes to the best model while one more is worth it. `slopes`: at its end.
  void grow(Linearised& slopes) {
    out_.last = analyse_at(*out_.best, slopes);
    std::optional<Trial> second = runner_up(out_.singles);
    while (int(out_.best->causes.size()) < options_.most_causes) {
      if (!further_seen(*out_.last) || predicts_to_the_floor(*out_.best)) return;
      if (trials_.cut()) return;
      if (options_.progress) options_.progress(0.85, "Looking for a further cause");
      std::vector<Attempt> attempts;
      extend(*out_.best, *out_.last, slopes, attempts);
      if (out_.best->causes.size() == 1) add_pairs(attempts);
      if (second) extend_runner_up(*second, attempts);
      std::vector<Trial> trials = trials_.tried(std::move(attempts), "further refits");
      std::ranges::stable_sort(trials, {}, &Trial::evidence);
      if (trials.empty() || !trials_.better(*out_.best, trials.front())) return;
      second = runner_up(trials);
      Trial next = std::move(trials.front());
      eliminate(next);
      if (next.causes.size() <= out_.best->causes.size() && next.evidence >= out_.best->evidence) {
        return;
      }
      adopt(std::move(next), slopes);
    }
  }

  /// Makes `trial` the best model and looks at what is left beside it.
  void adopt(Trial trial, Linearised& slopes) {
    out_.best = std::move(trial);
    out_.looseness = looseness_of(out_.best->refit);
    out_.last = analyse_at(*out_.best, slopes);
  }

  /// Attempts with each of the best few causes beside those of `trial`, by what was seen there.
  void extend(const Trial& trial, const Analysis& seen, const Linearised& slopes,
              std::vector<Attempt>& attempts) const {
    const auto of_use = [&](const Score& score) {
      return stands(study_.model(), score.candidate, trial.causes);
    };
    for (const std::size_t k : unlike_shapes(seen.test, seen.scores, kFurther, of_use)) {
      const Score& score = seen.scores[k];
      std::vector<Candidate> causes = trial.causes;
      causes.push_back(score.candidate);
      const State& state = trial.refit.state;
      attempts.push_back(
          {std::move(causes),
           {{extended(study_.model(), state, score.candidate, score.estimate, 1.0),
             extended(study_.model(), state, score.candidate, score.estimate, 0.5)},
            beside(beside(slopes.theta, slopes.active), columns_of(slopes, score.candidate))}});
      attempts.back().start.corrections = trial.refit.corrections;
    }
  }

  /// The best of sorted trials whose effects are others than the first's; none without any.
  static std::optional<Trial> runner_up(const std::vector<Trial>& trials) {
    const auto effects = [](const Trial& trial) {
      std::vector<int> of;
      for (const Candidate& cause : trial.causes) of.push_back(cause.effect);
      std::ranges::sort(of);
      return of;
    };
    for (const Trial& trial : trials) {
      if (effects(trial) != effects(trials.front())) return trial;
    }
    return std::nullopt;
  }

  /// Extends the second best model too while the best leaves much: one that explains most by itself
  /// may be what is there beside something else, while the best does a little of both.
  void extend_runner_up(const Trial& second, std::vector<Attempt>& attempts) const {
    if (looseness_of(out_.best->refit) < kFarOff) return;
    if (share_of_excess(out_.base.refit, second.refit) < kMost) return;
    Linearised slopes;
    const Analysis seen = analyse_at(second, slopes);
    if (further_seen(seen)) extend(second, seen, slopes, attempts);
  }

  /// What is left beside `trial`: first with the derivatives that are there, which cost nothing;
  /// where those see something, with new ones. `slopes` are those that were used.
  [[nodiscard]] Analysis analyse_at(const Trial& trial, Linearised& slopes) const {
    const auto analysed = [&] {
      return analyse(study_, trial.refit.state, slopes, out_.spread, out_.noise,
                     trial.refit.prediction, trial.refit.bias, options_.analysis);
    };
    slopes = linearised_at(trial.refit);
    for (const Linearised::Column& column : out_.slopes.columns) {
      const bool active = std::ranges::any_of(trial.causes, [&](const Candidate& cause) {
        return cause.effect == column.candidate.effect;
      });
      if (!active) slopes.columns.push_back(column);
    }
    Analysis found = analysed();
    if (!further_seen(found) || trials_.cut()) return found;
    study_.begin("further derivatives");
    slopes = linearise_keeping(study_, trial.refit.state,
                               candidates_of(study_.model(), trial.refit.state),
                               options_.refit.differences, slopes.theta);
    return analysed();
  }

  [[nodiscard]] bool further_seen(const Analysis& analysis) const {
    const std::vector<std::size_t> order = best_shapes(analysis.scores);
    return !order.empty() && is_seen(analysis, analysis.scores[order.front()]);
  }

  /// Whether a score is above what noise makes.
  [[nodiscard]] bool is_seen(const Analysis& analysis, const Score& score) const {
    return analysis.placebo.p(score.equivalent) < options_.further_level;
  }

  /// Whether what was kept back is predicted as well as noise and solver let it be: a further cause
  /// could show itself nowhere.
  [[nodiscard]] bool predicts_to_the_floor(const Trial& trial) const {
    const Gain g = judge_.gain_of(trial.opinion, trial.opinion, trial.numbers, options_.gain);
    return judge_.rows().size() > 0 && !g.measurable;
  }

  /// All pairs of the best eight by their joint score; the best two are refitted, and what is no
  /// cause by itself with what it stands beside.
  void add_pairs(std::vector<Attempt>& attempts) const {
    const State& base = out_.base_state;
    const std::vector<std::size_t> all = best_shapes(out_.first->scores);
    std::vector<std::size_t> order(all.begin(),
                                   all.begin() + std::ptrdiff_t(std::min(all.size(), kOfPairs)));
    const auto candidate = [&](std::size_t k) { return out_.first->scores[k].candidate; };
    const auto alone = [&](std::size_t k) { return stands(study_.model(), candidate(k), {}); };
    std::erase_if(order, [&](std::size_t k) { return !alone(k); });
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
    for (const std::size_t l : all) {
      if (alone(l) || !is_seen(*out_.first, out_.first->scores[l])) continue;
      if (stands(study_.model(), candidate(l), out_.best->causes)) continue;  // extend() has it
      for (const std::size_t k : all) {
        if (stands(study_.model(), candidate(l), {candidate(k)})) pairs.push_back({0.0, k, l});
      }
    }
    for (const Found& found : pairs) {
      auto estimate = out_.first->test.pair(out_.first->numerators, found.k, found.l);
      // A cause that another one stands beside does something at the start.
      if (!alone(found.l)) estimate.first = estimate.first.cwiseMax(kStandsOn);
      const Candidate a = candidate(found.k);
      const Candidate b = candidate(found.l);
      const State one = extended(study_.model(), base, a, estimate.first, 1.0);
      const State half = extended(study_.model(), base, a, estimate.first, 0.5);
      attempts.push_back({{a, b},
                          {{extended(study_.model(), one, b, estimate.second, 1.0),
                            extended(study_.model(), half, b, estimate.second, 0.5)},
                           beside(beside(out_.slopes.theta, columns_of(out_.slopes, a)),
                                  columns_of(out_.slopes, b))}});
    }
  }

  /// Takes out causes without which the model is as good.
  void eliminate(Trial& trial) {
    for (std::size_t c = 0; c < trial.causes.size() && trial.causes.size() > 1;) {
      std::optional<Trial> fewer;
      if (!is_needed(trial, c)) fewer = without(trial, c);
      if (!fewer || trials_.better(*fewer, trial)) {
        ++c;
      } else {
        trial = std::move(*fewer);
        c = 0;
      }
    }
  }

  /// Whether another cause stands only beside cause c.
  [[nodiscard]] bool is_needed(const Trial& trial, std::size_t c) const {
    std::vector<Candidate> others = trial.causes;
    others.erase(others.begin() + std::ptrdiff_t(c));
    return std::ranges::any_of(
        others, [&](const Candidate& other) { return !stands(study_.model(), other, others); });
  }

  /// Tries other causes in the place of each of several: those that the catalogue calls like it and
  /// that have no more numbers, with the values that come nearest to what it does. The simplest of
  /// the models that are nearly as likely stays.
  void exchange(Linearised& slopes) {
    std::vector<Attempt> attempts;
    for (std::size_t c = 0; c < out_.best->causes.size(); ++c) {
      if (is_needed(*out_.best, c)) continue;
      std::size_t tried = 0;
      for (const Candidate& other : like(c)) {
        if (tried++ < kFurther) put_in_place(c, other, slopes, attempts);
      }
    }
    if (attempts.empty()) return;
    if (options_.progress) options_.progress(0.88, "Refitting with what is like each cause");
    std::vector<Trial> trials = trials_.tried(std::move(attempts), "further refits");
    if (trials.empty()) return;
    trials.push_back(*out_.best);
    std::ranges::stable_sort(trials, {}, &Trial::evidence);
    put_simplest_first(trials);
    if (trials.front().causes == out_.best->causes) return;
    adopt(std::move(trials.front()), slopes);
  }

  /// Causes that the catalogue calls like the best model's cause c or that are called like it, in
  /// their best shapes, with no more numbers, of which the best model has none.
  [[nodiscard]] std::vector<Candidate> like(std::size_t c) const {
    const std::vector<Effect>& effects = study_.model().effects();
    std::vector<Candidate> others = out_.best->causes;
    const Effect& own = effects[std::size_t(others[c].effect)];
    others.erase(others.begin() + std::ptrdiff_t(c));
    std::vector<Candidate> result;
    for (const std::size_t k : best_shapes(out_.first->scores)) {
      const Candidate& candidate = out_.first->scores[k].candidate;
      const Effect& other = effects[std::size_t(candidate.effect)];
      const bool there = std::ranges::any_of(out_.best->causes, [&](const Candidate& known) {
        return known.effect == candidate.effect;
      });
      const bool alike = std::ranges::count(own.confused_with, other.name) > 0 ||
                         std::ranges::count(other.confused_with, own.name) > 0;
      if (!there && alike && other.numbers.size() <= own.numbers.size() &&
          stands(study_.model(), candidate, others)) {
        result.push_back(candidate);
      }
    }
    return result;
  }

  /// Adds an attempt with `other` in place of the best model's cause c, by slopes at that model.
  void put_in_place(std::size_t c, const Candidate& other, const Linearised& slopes,
                    std::vector<Attempt>& attempts) const {
    const MatrixXd& columns = columns_of(slopes, other);
    if (columns.cols() == 0) return;
    const Trial& best = *out_.best;
    const std::vector<Number>& numbers =
        study_.model().effects()[std::size_t(best.causes[c].effect)].numbers;
    const Active& active = best.refit.state.causes[c];
    VectorXd strength(active.values.size());
    for (Index k = 0; k < strength.size(); ++k) {
      const Number& number = numbers[std::size_t(k)];
      strength[k] = (active.values[k] - number.neutral) / number.scale;
    }
    const Index rows = std::min(columns.rows(), slopes.active.rows());
    const VectorXd change =
        slopes.active.middleCols(first_of(best, c), strength.size()).topRows(rows) * strength;
    const VectorXd estimate = columns.topRows(rows).completeOrthogonalDecomposition().solve(change);
    Attempt attempt = fewer_by(best, c);
    attempt.causes.push_back(other);
    State& state = attempt.start.states.front();
    state = extended(study_.model(), state, other, estimate, 1.0);
    attempt.start.slopes = beside(attempt.start.slopes, columns);
    attempts.push_back(std::move(attempt));
  }

  /// Where the numbers of cause c begin among those of all causes.
  static Index first_of(const Trial& trial, std::size_t c) {
    Index first = 0;
    for (std::size_t before = 0; before < c; ++before) {
      first += trial.refit.state.causes[before].values.size();
    }
    return first;
  }

  /// A trial without its cause c, as it stands.
  static Attempt fewer_by(const Trial& trial, std::size_t c) {
    Attempt attempt{trial.causes, {{trial.refit.state}, {}}};
    attempt.start.corrections = trial.refit.corrections;
    State& state = attempt.start.states.front();
    const Index first = state.theta.size() + first_of(trial, c);
    const Index count = state.causes[c].values.size();
    const MatrixXd& slopes = trial.refit.slopes;
    attempt.start.slopes =
        beside(slopes.leftCols(first), slopes.rightCols(slopes.cols() - first - count));
    state.causes.erase(state.causes.begin() + std::ptrdiff_t(c));
    attempt.causes.erase(attempt.causes.begin() + std::ptrdiff_t(c));
    return attempt;
  }

  [[nodiscard]] std::optional<Trial> without(const Trial& trial, std::size_t c) const {
    std::vector<Attempt> attempts;
    attempts.push_back(fewer_by(trial, c));
    std::vector<Trial> trials = trials_.tried(std::move(attempts), "further refits");
    if (trials.empty()) return std::nullopt;
    return std::move(trials.front());
  }

  const Study& study_;
  const Trials& trials_;
  const Judge& judge_;
  const ExtendOptions& options_;
  Extension& out_;
};

}  // namespace

void add_further_causes(const Study& study, const Trials& trials, const Judge& judge,
                        const ExtendOptions& options, Extension& out) {
  if (out.best) Further(study, trials, judge, options, out).run();
}

}  // namespace matterfit::diagnose
