// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/extend.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

#include "diagnose/accept.hpp"
#include "diagnose/approach.hpp"
#include "diagnose/far_starts.hpp"
#include "diagnose/further.hpp"
#include "diagnose/mates.hpp"
#include "diagnose/onset.hpp"
#include "diagnose/starts.hpp"

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
/// Share of the best cause's score from which on a cause that the catalogue calls like it is
/// refitted.
constexpr double kMateScore = 0.25;
/// How often the searches of base and best causes may begin again.
constexpr int kMoreRounds = 3;
/// Causes that are fitted together for a start.
constexpr std::size_t kTogether = 6;
/// χ²/dof of the base beyond which causes with set values are tried whatever the scores are.
constexpr double kMuchLeft = 2.0;

class Search {
 public:
  Search(const Study& study, int members, const ExtendOptions& options)
      : study_(study), members_(members), options_(options) {}

  Extension run() {
    const bool corrected = !study_.model().corrections().empty();
    if (corrected) {
      // Weighed with the solver's errors the base ends elsewhere again, so causes wait until it
      // has.
      tell(0.0, "Refitting");
      study_.begin_search("refits");
      const Approach near = come_near(study_, study_.fitted(), options_.refit);
      out_.began_elsewhere = near.elsewhere;
      linearise_base(near.state, {});
    } else {
      linearise_base(study_.fitted(), all_candidates());
    }
    estimate_from(study_.measured() - out_.slopes.prediction);
    fit_base(true);
    fit_together();
    try_singles();
    // What no longer counts as discrepancy may have counted as noise, and the other way round.
    if (!out_.singles.empty() || corrected) {
      const Noise before = out_.noise;
      const bool plain = out_.singles.empty() || out_.base.evidence < out_.singles.front().evidence;
      const Trial& best = plain ? out_.base : out_.singles.front();
      estimate_from(study_.measured() - best.refit.prediction);
      // Wide enough for both; each is searched, and its evidence counted, by its own.
      base_corrections_ = out_.base.corrections;
      out_.noise.corrections = std::max(base_corrections_, best.corrections);
      if (differ(before, out_.noise)) {
        fit_base(false);
        fit_together();
        try_singles();
      }
    }
    if (settle()) {
      // Scores of a base that was left behind would be those of another motion.
      linearise_base(out_.base.refit.state, all_candidates(), 0.82);
      score_all(0.84);
    }
    try_mates();
    choose();
    add_further_causes(study_, *trials_, *judge_, options_, out_);
    accept(study_, *refitter_, *judge_, options_, out_);
    out_.law = free_law(study_, *trials_, *judge_, options_, out_);
    return std::move(out_);
  }

 private:
  void tell(double fraction, const std::string& what) const {
    if (options_.progress) options_.progress(fraction, what);
  }

  [[nodiscard]] std::vector<Candidate> all_candidates() const {
    return candidates_of(study_.model(), study_.fitted());
  }

  void linearise_base(const State& state, const std::vector<Candidate>& candidates,
                      double progress = 0.0) {
    tell(progress, "Differentiating");
    study_.begin("derivatives");
    out_.base_state = state;
    out_.slopes = linearise(study_, state, candidates, options_.refit.differences);
    // The solver's own error is not another one a little beside.
    if (out_.spread.members.rows() > 0) return;
    tell(0.2, "Measuring the solver's own error");
    study_.begin("solver");
    out_.spread = numerical_spread(study_, state, out_.slopes.theta, {.members = members_});
  }

  void differentiate_causes() {
    tell(0.4, "Differentiating all causes");
    study_.begin("derivatives");
    DifferenceOptions differences = options_.refit.differences;
    for (Index p = 0; p < out_.base_state.theta.size(); ++p) differences.left_out.push_back(p);
    out_.slopes.columns = linearise(study_, out_.base_state, all_candidates(), differences).columns;
  }

  void estimate_from(const VectorXd& stacked) {
    const double corrections = out_.noise.corrections;
    out_.noise = noise_left(study_, stacked, out_.slopes, out_.spread);
    out_.noise.corrections = corrections;
  }

  [[nodiscard]] RefitStart base_start() const {
    RefitStart start{{out_.base_state}, out_.slopes.theta};
    start.made_there = true;
    start.corrections = base_corrections_;
    return start;
  }

  /// `far`: from where the base may have far to go.
  void fit_base(bool far) {
    tell(0.4, "Refitting");
    study_.begin_search("refits");
    refitter_.emplace(study_, out_.noise, out_.spread, options_.refit);
    out_.base = Trial{};
    RefitStart start = base_start();
    start.whole = far;
    out_.base.refit = refitter_->fit(std::move(start));
    const VectorXd first = refitter_->whitening().apply(
        (study_.measured() - out_.slopes.prediction).head(study_.used().size()));
    // The fit ended elsewhere under its own weights: derivatives are taken anew where that matters.
    const bool moved =
        first.squaredNorm() - out_.base.refit.chi_square > 5.0 + 0.02 * out_.base.refit.chi_square;
    if (moved || out_.slopes.columns.empty()) {
      if (moved) {
        linearise_base(out_.base.refit.state, all_candidates(), 0.4);
      } else {
        differentiate_causes();
      }
      estimate_from(study_.measured() - out_.base.refit.prediction);
      study_.begin_search("refits");
      refitter_.emplace(study_, out_.noise, out_.spread, options_.refit);
      out_.base.refit = refitter_->fit(base_start());
    }
    judge_.emplace(study_, out_.noise, out_.spread, out_.slopes.theta, options_.refit);
    study_.begin("held-out");
    const Refit* const base = &out_.base.refit;
    out_.base.opinion = std::move(judge_->judge({&base, 1}).front());
    trials_.emplace(study_, *refitter_, *judge_);
    trials_->temper(out_.base);
    trials_->weigh(out_.base);
    score_all();
  }

  void score_all(double progress = 0.45) {
    tell(progress, "Scoring all causes");
    out_.first = analyse(study_, out_.base_state, out_.slopes, out_.spread, out_.noise,
                         out_.slopes.prediction, 0.0, options_.analysis);
    if (!out_.spread.known()) return;
    Linearised held = out_.slopes;
    hold_corrections(study_.model(), out_.base_state, held.prediction, held.theta);
    const Analysis exact = analyse(study_, out_.base_state, held, Spread::none(study_.size()),
                                   out_.noise, held.prediction, 0.0, options_.analysis);
    double largest = 0.0;
    for (const Score& score : exact.scores) largest = std::max(largest, score.equivalent);
    out_.exact_solver_significant = exact.smooth.p < 0.01 || exact.placebo.p(largest) < 0.01;
  }

  /// Where the base is far off, what it lacks has pulled the material along, and a cause's own
  /// first estimate from there is of another motion. With the best few causes at once the search
  /// comes nearer to what it was, and each cause may begin there by itself.
  void fit_together() {
    together_.reset();
    if (looseness_of(out_.base.refit) < kFarOff) return;
    const std::vector<Score>& scores = out_.first->scores;
    const std::vector<std::size_t> chosen =
        unlike_shapes(out_.first->test, scores, kTogether, [&](const Score& score) {
          return effect_of(score).onsets.empty() && stands(study_.model(), score.candidate, {}) &&
                 out_.first->placebo.p(score.equivalent) < options_.analysis.placebo.level;
        });
    if (chosen.size() < 2) return;
    tell(0.48, fmt::format("Refitting with {} causes together", chosen.size()));
    study_.begin_search("refits");
    RefitStart start = base_start();
    for (const std::size_t k : chosen) {
      const Score& score = scores[k];
      start.states.front() =
          extended(study_.model(), start.states.front(), score.candidate, score.estimate, 0.0);
      start.slopes = beside(start.slopes, columns_of(out_.slopes, score.candidate));
    }
    start.rough = true;
    std::vector<RefitStart> starts;
    starts.push_back(std::move(start));
    const std::vector<std::optional<Refit>> refits = refitter_->fit_all(std::move(starts));
    if (refits.front()) together_ = refits.front()->state;
  }

  /// A search that was far off at first may need more slopes than others to get to its end, and one
  /// with a cause may find what the base's has missed, which is no evidence for the cause: the base
  /// goes on from where the best cause ended, and causes from where the base ended, until neither
  /// gains. Whether the base has gained.
  bool settle() {
    bool base_moved = false;
    for (int round = 0; round < kMoreRounds && !out_.singles.empty(); ++round) {
      if (trials_->cut()) break;
      tell(0.8, "Refitting with the best causes");
      const bool far_off = looseness_of(out_.singles.front().refit) > kFarOff;
      if (far_off) (void)go_on(out_.singles, out_.singles.front().refit.state.theta);
      std::vector<Trial> base;
      base.push_back(std::move(out_.base));
      const bool moved = go_on(base, out_.singles.front().refit.state.theta);
      out_.base = std::move(base.front());
      base_moved = base_moved || moved;
      if (!moved || !far_off) break;
      if (!go_on(out_.singles, out_.base.refit.state.theta)) break;
    }
    return base_moved;
  }

  /// Refits the best few trials, and those whose causes were tried at set values, from where they
  /// are or from `theta` (of one of them at most: it is read first) with their causes. Whether any
  /// gained what would decide between rivals.
  bool go_on(std::vector<Trial>& trials, const VectorXd& theta) const {
    std::vector<Attempt> attempts;
    std::vector<std::size_t> of;
    for (std::size_t k = 0; k < trials.size(); ++k) {
      const Trial& trial = trials[k];
      const bool tried =
          !trial.causes.empty() &&
          !study_.model().effects()[std::size_t(trial.causes.front().effect)].tries.empty();
      if (k >= kAlways && !tried) continue;
      const State& own = trial.refit.state;
      const bool there = trial.refit.converged && own.theta == theta;
      if (there) continue;
      std::vector<State> states{{theta, own.causes}};
      if (own.theta != theta) states.push_back(own);
      attempts.push_back({trial.causes, {std::move(states), trial.refit.slopes, 0, true}});
      attempts.back().start.corrections = trial.corrections;
      of.push_back(k);
    }
    bool gained = false;
    std::vector<Trial> again = trials_->tried(std::move(attempts), "refits");
    for (Trial& next : again) {
      for (const std::size_t k : of) {
        if (trials[k].causes != next.causes || !(next.evidence < trials[k].evidence)) continue;
        const double decides = kExcluded * looseness_of(next.refit);
        gained = gained || trials[k].evidence - next.evidence > decides;
        trials[k] = std::move(next);
        break;
      }
    }
    std::ranges::stable_sort(trials, {}, &Trial::evidence);
    return gained;
  }

  void try_singles() {
    // Where a refit of the pass before ended is the better start.
    std::vector<Trial> known = std::move(out_.singles);
    out_.singles.clear();
    const std::vector<Score>& scores = out_.first->scores;
    std::vector<std::size_t> order = best_shapes(scores);
    std::erase_if(order,
                  [&](std::size_t k) { return !stands(study_.model(), scores[k].candidate, {}); });
    if (order.empty()) return;
    const Score& top = scores[order.front()];
    std::vector<Attempt> attempts;
    add_onsets(scores, known, attempts);
    // Scores say nothing of what is seen at set values only.
    if (out_.first->placebo.p(top.equivalent) < options_.analysis.placebo.level ||
        looseness_of(out_.base.refit) > kMuchLeft) {
      for (const Score& score : scores) {
        if (effect_of(score).tries.empty()) continue;
        attempts.push_back({{score.candidate}, single_start(score, known)});
      }
    }
    add_far_tries(known, attempts);
    const std::size_t set = attempts.size();
    for (const std::size_t k : order) {
      if (int(attempts.size() - set) >= options_.refits) break;
      const Score& score = scores[k];
      if (!effect_of(score).onsets.empty() || !effect_of(score).tries.empty()) continue;
      if (is_attempted(score.candidate.effect, attempts)) continue;
      if (out_.first->placebo.p(score.equivalent) >= options_.analysis.placebo.level) break;
      const double imitates = out_.first->test.imitation(order.front(), top.estimate, k);
      const bool like = top.statistic * (1.0 - imitates) < kExcluded ||
                        score.statistic > kNearScore * top.statistic;
      if (!like && attempts.size() - set >= kAlways) continue;
      attempts.push_back({{score.candidate}, single_start(score, known)});
    }
    if (attempts.empty()) return;
    tell(0.5, fmt::format("Refitting with {} causes", attempts.size()));
    out_.singles = trials_->tried(std::move(attempts), "refits");
    std::ranges::stable_sort(out_.singles, {}, &Trial::evidence);
  }

  /// A base that is far off has scores of another motion: what is known to be like the best cause
  /// is refitted from there, whatever its score says; elsewhere what has a share of its score.
  void try_mates() {
    if (out_.singles.empty() || trials_->cut()) return;
    const Trial& best = out_.singles.front();
    const double loose = looseness_of(out_.base.refit);
    const bool far_off = loose >= kFarOff;
    if (!far_off && out_.base.evidence - best.evidence < kExcluded * loose) return;
    std::vector<int> known;
    for (const Trial& trial : out_.singles) known.push_back(trial.causes.front().effect);
    const std::vector<Candidate> mates = mates_of(
        study_.model(), out_.first->scores, best.causes.front(), known, far_off ? 0.0 : kMateScore);
    if (mates.empty()) return;
    tell(0.82, "Refitting with causes that are like the best");
    study_.begin_search("refits");
    std::vector<Attempt> attempts;
    for (auto& [mate, start] : starts_beside(study_, refitter_->whitening(), best.refit, mates,
                                             options_.refit.differences)) {
      start.corrections = best.corrections;
      attempts.push_back({{mate}, std::move(start)});
    }
    for (Trial& trial : trials_->tried(std::move(attempts), "refits")) {
      out_.singles.push_back(std::move(trial));
    }
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
      if (known_of(score, known) != nullptr) {
        attempts.push_back({{score.candidate}, single_start(score, known)});
        continue;
      }
      const double onset = onsets[std::size_t(score.candidate.variant)];
      const auto [at, fresh] = before_onset_.try_emplace(onset);
      if (fresh) {
        study_.begin_search("refits");
        at->second = fitted_before(study_, out_.noise, out_.spread, out_.base_state,
                                   out_.slopes.theta, onset, options_.refit);
      }
      attempts.push_back(
          {{score.candidate},
           at->second ? onset_start(score, *at->second) : single_start(score, known)});
    }
  }

  /// Adds causes that name sizes to be looked for from far off, where the base is.
  void add_far_tries(std::vector<Trial>& known, std::vector<Attempt>& attempts) const {
    if (looseness_of(out_.base.refit) < kMuchLeft) return;
    std::vector<int> begun;
    for (Trial& trial : known) {
      const Candidate cause = trial.causes.front();
      if (study_.model().effects()[std::size_t(cause.effect)].far_tries.empty()) continue;
      begun.push_back(cause.effect);
      attempts.push_back({{cause}, again(trial)});
    }
    if (trials_->cut()) return;
    study_.begin_search("refits");
    std::vector<Attempt> looked = far_starts(*refitter_, out_.base_state, out_.slopes.theta, begun);
    std::ranges::move(looked, std::back_inserter(attempts));
  }

  static bool is_attempted(int effect, const std::vector<Attempt>& attempts) {
    return std::ranges::any_of(
        attempts, [&](const Attempt& attempt) { return attempt.causes.front().effect == effect; });
  }

  /// A start where a trial of the pass before ended.
  [[nodiscard]] RefitStart again(Trial& trial) const {
    RefitStart start{{trial.refit.state}, {}};
    start.corrections = refitter_->corrections_of(trial.refit).size;
    start.slopes = std::move(trial.refit.slopes);
    return start;
  }

  /// The refit of a candidate in the pass before; null without any.
  static Trial* known_of(const Score& score, std::vector<Trial>& known) {
    const auto found = std::ranges::find_if(
        known, [&](const Trial& trial) { return trial.causes.front() == score.candidate; });
    return found == known.end() ? nullptr : &*found;
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
    if (Trial* trial = known_of(score, known)) return again(*trial);
    // A first estimate may be far off, so the base itself is a start.
    RefitStart start{{}, beside(out_.slopes.theta, columns_of(out_.slopes, score.candidate))};
    for (const double share : {1.0, 0.5, 0.0}) {
      start.states.push_back(
          extended(study_.model(), out_.base_state, score.candidate, score.estimate, share));
    }
    const Effect& effect = effect_of(score);
    for (const double value : effect.tries) {
      VectorXd there = VectorXd::Zero(score.estimate.size());
      there[0] = (value - effect.numbers[0].neutral) / effect.numbers[0].scale;
      start.states.push_back(
          extended(study_.model(), out_.base_state, score.candidate, there, 1.0));
      start.renew = true;
    }
    if (together_) {
      State state{together_->theta, {}};
      for (const Active& cause : together_->causes) {
        if (cause.effect == score.candidate.effect && cause.variant == score.candidate.variant) {
          state.causes.push_back(cause);
        }
      }
      if (!state.causes.empty()) {
        start.states.push_back(std::move(state));
        // Slopes of the base are of another place.
        ++start.renewals;
      }
    }
    return start;
  }

  void choose() {
    if (out_.singles.empty()) return;
    put_simplest_first(out_.singles);
    out_.best = out_.singles.front();
    out_.looseness = looseness_of(out_.best->refit);
  }

  const Study& study_;
  int members_;
  const ExtendOptions& options_;
  std::map<double, std::optional<State>> before_onset_;  ///< by the time
  std::optional<State> together_;  ///< the base with the best few causes at once
  double base_corrections_ = 0.0;  ///< of the base's searches; 0: as stated
  Extension out_;
  std::optional<Refitter> refitter_;
  std::optional<Judge> judge_;
  std::optional<Trials> trials_;
};

}  // namespace

Extension extend(const Study& study, int members, const ExtendOptions& options) {
  return Search(study, members, options).run();
}

}  // namespace matterfit::diagnose
