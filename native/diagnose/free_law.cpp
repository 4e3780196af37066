// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/free_law.hpp"

#include <algorithm>
#include <utility>

#include "diagnose/accept.hpp"
#include "diagnose/extend.hpp"
#include "diagnose/starts.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;

std::optional<Candidate> last_of(const Model& model) {
  const auto found = std::ranges::find_if(model.effects(), &Effect::last);
  if (found == model.effects().end()) return std::nullopt;
  return Candidate{int(found - model.effects().begin()), 0};
}

class LawLast {
 public:
  LawLast(const Study& study, const Trials& trials, const Judge& judge,
          const ExtendOptions& options, const Extension& found, const Candidate& law)
      : study_(study),
        trials_(trials),
        judge_(judge),
        options_(options),
        found_(found),
        law_(law) {}

  std::optional<FreeLaw> run() {
    Linearised slopes = found_.slopes;
    if (!add_law(found_.base_state, slopes)) return std::nullopt;
    const Analysis all = analyse(study_, found_.base_state, slopes, found_.spread, found_.noise,
                                 slopes.prediction, 0.0, options_.analysis);
    FreeLaw result;
    result.candidate = law_;
    const std::size_t own = all.scores.size() - 1;
    result.score = all.scores[own];
    result.p = all.placebo.p(result.score.equivalent);
    for (std::size_t k = 0; k < found_.first->scores.size(); ++k) {
      const Score& score = found_.first->scores[k];
      const bool seen = score.observable && result.score.observable;
      result.absorbed.push_back(seen ? all.test.imitation(k, score.estimate, own) : 0.0);
    }
    if (!result.score.observable || found_.within_solver || trials_.cut()) return result;
    if (!found_.accepted) {
      if (result.p < options_.analysis.placebo.level) {
        result.alone = tried(found_.base, found_.base_state, result.score, slopes);
      }
    } else if (found_.last && found_.last->smooth.p < options_.further_level) {
      result.beside = beside_best();
    }
    return result;
  }

 private:
  /// Appends the law's column at a state; whether there is one.
  bool add_law(const State& state, Linearised& slopes) const {
    study_.begin("derivatives");
    DifferenceOptions differences = options_.refit.differences;
    for (Index p = 0; p < state.theta.size(); ++p) differences.left_out.push_back(p);
    const Linearised freed = linearise(study_, state, {law_}, differences);
    if (freed.columns.empty() || freed.columns.front().values.cols() == 0) return false;
    slopes.columns.push_back(freed.columns.front());
    return true;
  }

  /// By what the best extension leaves, with the law alone to be scored there.
  [[nodiscard]] std::optional<LawTrial> beside_best() const {
    const Refit& best = found_.best->refit;
    Linearised slopes = linearised_at(best);
    if (!add_law(best.state, slopes)) return std::nullopt;
    const Analysis there = analyse(study_, best.state, slopes, found_.spread, found_.noise,
                                   best.prediction, best.bias, options_.analysis);
    const Score& score = there.scores.front();
    if (!(there.placebo.p(score.equivalent) < options_.further_level)) return std::nullopt;
    return tried(*found_.best, best.state, score, slopes);
  }

  /// Refits the law beside a model, from `state` and the score's estimate there.
  [[nodiscard]] std::optional<LawTrial> tried(const Trial& without, const State& state,
                                              const Score& score, const Linearised& slopes) const {
    Attempt attempt;
    attempt.causes = without.causes;
    attempt.causes.push_back(law_);
    for (const double share : {1.0, 0.5, 0.0}) {
      attempt.start.states.push_back(extended(study_.model(), state, law_, score.estimate, share));
    }
    attempt.start.slopes = beside(beside(slopes.theta, slopes.active), columns_of(slopes, law_));
    attempt.start.corrections = without.corrections;
    attempt.start.rough = true;  // such simulations are dear
    std::vector<Attempt> attempts;
    attempts.push_back(std::move(attempt));
    std::vector<Trial> refitted = trials_.tried(std::move(attempts), "free law refits");
    if (refitted.empty()) return std::nullopt;
    LawTrial result;
    result.trial = std::move(refitted.front());
    const int numbers = result.trial.numbers - without.numbers;
    result.trial.gain =
        judge_.gain_of(without.opinion, result.trial.opinion, numbers, options_.gain);
    result.explained = std::clamp(share_of_excess(without.refit, result.trial.refit), 0.0, 1.0);
    result.end = end_of(without, result.trial, numbers);
    return result;
  }

  [[nodiscard]] LawTrial::End end_of(const Trial& without, const Trial& with, int numbers) const {
    if (!trials_.better(without, with)) return LawTrial::End::kUnlikely;
    if (with.refit.at_bound) return LawTrial::End::kAtBound;
    if (!with.gain.measurable && !(without.opinion.deviance > 0.0)) return LawTrial::End::kNoTest;
    return predicts(with.gain, without.opinion, with.opinion, numbers) ? LawTrial::End::kImproves
                                                                       : LawTrial::End::kNoForecast;
  }

  const Study& study_;
  const Trials& trials_;
  const Judge& judge_;
  const ExtendOptions& options_;
  const Extension& found_;
  Candidate law_;
};

}  // namespace

std::optional<FreeLaw> free_law(const Study& study, const Trials& trials, const Judge& judge,
                                const ExtendOptions& options, const Extension& found) {
  const std::optional<Candidate> law = last_of(study.model());
  if (!law) return std::nullopt;
  if (options.progress) options.progress(0.95, "Looking at what a free law would explain");
  return LawLast(study, trials, judge, options, found, *law).run();
}

}  // namespace matterfit::diagnose
