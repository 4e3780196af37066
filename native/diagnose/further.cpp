// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/further.hpp"

#include <algorithm>
#include <utility>

#include "diagnose/starts.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// How many further causes are tried beside those that are there.
constexpr std::size_t kFurther = 3;
/// Share of the excess that a runner-up explains, beside which others are sought too.
constexpr double kMost = 0.5;

class Further {
 public:
  Further(const Study& study, const Trials& trials, const Judge& judge,
          const ExtendOptions& options, Extension& out)
      : study_(study), trials_(trials), judge_(judge), options_(options), out_(out) {}

  void run() {
    Linearised slopes;
    out_.last = analyse_at(*out_.best, slopes);
    while (int(out_.best->causes.size()) < options_.most_causes) {
      if (!further_seen(*out_.last) || predicts_to_the_floor(*out_.best)) return;
      if (trials_.cut()) return;
      if (options_.progress) options_.progress(0.85, "Looking for a further cause");
      std::vector<Attempt> attempts;
      extend(*out_.best, *out_.last, slopes, attempts);
      if (out_.best->causes.size() == 1) {
        add_pairs(attempts);
        extend_runner_up(attempts);
      }
      std::optional<Trial> next;
      for (Trial& trial : trials_.tried(std::move(attempts), "further refits")) {
        if (!next || trial.evidence < next->evidence) next = std::move(trial);
      }
      if (!next || !trials_.better(*out_.best, *next)) return;
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

 private:
  /// Attempts with each of the best few causes beside those of `trial`, by what was seen there.
  void extend(const Trial& trial, const Analysis& seen, const Linearised& slopes,
              std::vector<Attempt>& attempts) const {
    const std::vector<std::size_t> order = best_shapes(seen.scores);
    for (std::size_t i = 0; i < std::min(kFurther, order.size()); ++i) {
      const Score& score = seen.scores[order[i]];
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

  /// Where even the best cause leaves much, another one that explains most by itself may be the one
  /// that is there beside something else, while the best does a little of both.
  void extend_runner_up(std::vector<Attempt>& attempts) const {
    if (looseness_of(out_.best->refit) < kFarOff) return;
    const auto second = std::ranges::find_if(out_.singles, [&](const Trial& trial) {
      return trial.causes.front().effect != out_.best->causes.front().effect;
    });
    if (second == out_.singles.end()) return;
    if (share_of_excess(out_.base.refit, second->refit) < kMost) return;
    Linearised slopes;
    const Analysis seen = analyse_at(*second, slopes);
    if (further_seen(seen)) extend(*second, seen, slopes, attempts);
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
    if (!further_seen(found) || trials_.cut()) return found;
    study_.begin("further derivatives");
    slopes = linearise_keeping(study_, trial.refit.state,
                               candidates_of(study_.model(), trial.refit.state),
                               options_.refit.differences, slopes.theta);
    return analysed();
  }

  [[nodiscard]] bool further_seen(const Analysis& analysis) const {
    const std::vector<std::size_t> order = best_shapes(analysis.scores);
    return !order.empty() &&
           analysis.placebo.p(analysis.scores[order.front()].equivalent) < options_.further_level;
  }

  /// Whether what was kept back is predicted as well as noise and solver let it be: a further cause
  /// could show itself nowhere.
  [[nodiscard]] bool predicts_to_the_floor(const Trial& trial) const {
    const Gain g = judge_.gain_of(trial.opinion, trial.opinion, trial.numbers, options_.gain);
    return judge_.rows().size() > 0 && !g.measurable;
  }

  /// All pairs of the best eight by their joint score; the best two are refitted.
  void add_pairs(std::vector<Attempt>& attempts) const {
    const State& base = out_.base_state;
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
      std::optional<Trial> fewer = without(trial, c);
      if (!fewer || trials_.better(*fewer, trial)) {
        ++c;
      } else {
        trial = std::move(*fewer);
        c = 0;
      }
    }
  }

  [[nodiscard]] std::optional<Trial> without(const Trial& trial, std::size_t c) const {
    Attempt attempt{trial.causes, {{trial.refit.state}, {}}};
    attempt.start.corrections = trial.refit.corrections;
    State& state = attempt.start.states.front();
    Index first = state.theta.size();
    for (std::size_t before = 0; before < c; ++before) first += state.causes[before].values.size();
    const Index count = state.causes[c].values.size();
    const MatrixXd& slopes = trial.refit.slopes;
    attempt.start.slopes =
        beside(slopes.leftCols(first), slopes.rightCols(slopes.cols() - first - count));
    state.causes.erase(state.causes.begin() + std::ptrdiff_t(c));
    attempt.causes.erase(attempt.causes.begin() + std::ptrdiff_t(c));
    std::vector<Attempt> attempts;
    attempts.push_back(std::move(attempt));
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
