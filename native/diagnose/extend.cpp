// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/extend.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "diagnose/further.hpp"
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
/// How often the searches of base and best causes may begin again.
constexpr int kMoreRounds = 3;
/// The smallest deviation that counts as noise: rounding of single precision at a metre.
constexpr double kNoiseFloor = 1e-7;
/// The solver's error is extrapolated to first order: a tenth of the χ² it stands for, a third of
/// its size, may be the next order's.
constexpr double kExtrapolated = 0.1;
/// Standard errors by which a number of an accepted cause is beyond its neutral value.
constexpr double kTold = 2.0;
/// The same for a cause that leaves nothing to the solver.
constexpr double kSure = 5.0;
/// Share of the excess that such a cause explains at least.
constexpr double kNearlyAll = 0.8;
/// The same of one that takes away as much as this share of what the solver's error explains where
/// the cause is not there.
constexpr double kMostly = 0.5;
constexpr double kAsTheSolver = 0.5;
/// Causes that are fitted together for a start, and how much of one's signature another may
/// imitate.
constexpr std::size_t kTogether = 6;
constexpr double kAlike = 0.9;
/// χ²/dof above which the base is no place to begin from.
constexpr double kFarOff = 1.2;
/// A cause that is itself an acceleration field predicts what the free field does, to rounding.
constexpr double kAsGood = 1.02;

class Search {
 public:
  Search(const Study& study, int members, const ExtendOptions& options)
      : study_(study), members_(members), options_(options) {}

  Extension run() {
    linearise_base(study_.fitted());
    estimate_from(study_.measured() - out_.slopes.prediction);
    fit_base();
    fit_together();
    try_singles();
    // What no longer counts as discrepancy may have counted as noise, and the other way round.
    const bool corrected = !study_.model().corrections().empty();
    if (!out_.singles.empty() || corrected) {
      const Noise before = out_.noise;
      const bool plain = out_.singles.empty() || out_.base.evidence < out_.singles.front().evidence;
      const Refit& best = plain ? out_.base.refit : out_.singles.front().refit;
      estimate_from(study_.measured() - best.prediction);
      // Wide enough for both; evidence counts each by its own.
      out_.noise.corrections =
          std::max(refitter_->corrections_of(out_.base.refit), refitter_->corrections_of(best));
      if (changed(before, out_.noise)) {
        fit_base();
        fit_together();
        try_singles();
      }
    }
    if (settle()) {
      // Scores of a base that was left behind would be those of another motion.
      linearise_base(out_.base.refit.state, 0.82);
      score_all(0.84);
    }
    choose();
    add_further_causes(study_, *trials_, *judge_, options_, out_);
    accept();
    return std::move(out_);
  }

 private:
  void tell(double fraction, const std::string& what) const {
    if (options_.progress) options_.progress(fraction, what);
  }

  void linearise_base(const State& state, double progress = 0.0) {
    tell(progress, "Differentiating all causes");
    study_.begin("derivatives");
    out_.base_state = state;
    out_.slopes =
        linearise(study_, state, candidates_of(study_.model(), state), options_.refit.differences);
    // The solver's own error is not another one a little beside.
    if (out_.spread.members.rows() > 0) return;
    tell(0.2, "Measuring the solver's own error");
    study_.begin("solver");
    out_.spread = numerical_spread(study_, state, out_.slopes.theta, {.members = members_});
  }

  void estimate_from(const VectorXd& stacked) {
    const double corrections = out_.noise.corrections;
    out_.noise =
        estimate_noise(study_.used(), study_.model().captures(), stacked.head(study_.used().size()),
                       explained_columns(study_, out_.slopes, out_.spread), kNoiseFloor,
                       body_turns(study_.used(), study_.model().captures(),
                                  out_.slopes.prediction.head(study_.used().size())));
    out_.noise.corrections = corrections;
  }

  static bool changed(const Noise& a, const Noise& b) {
    if (std::abs(std::log(a.corrections / b.corrections)) > 0.1) return true;
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
    out_.base.refit = refitter_->fit({{out_.base_state}, out_.slopes.theta});
    const VectorXd first = refitter_->whitening().apply(
        (study_.measured() - out_.slopes.prediction).head(study_.used().size()));
    // The fit ended elsewhere under its own weights: derivatives are taken anew where that matters.
    if (first.squaredNorm() - out_.base.refit.chi_square >
        5.0 + 0.02 * out_.base.refit.chi_square) {
      linearise_base(out_.base.refit.state);
      estimate_from(study_.measured() - out_.base.refit.prediction);
      study_.begin("refits");
      refitter_.emplace(study_, out_.noise, out_.spread, options_.refit);
      out_.base.refit = refitter_->fit({{out_.base_state}, out_.slopes.theta});
    }
    judge_.emplace(study_, out_.noise, out_.spread, out_.slopes.theta, options_.refit);
    study_.begin("held-out");
    const Refit* const base = &out_.base.refit;
    out_.base.opinion = std::move(judge_->judge({&base, 1}).front());
    trials_.emplace(study_, *refitter_, *judge_);
    trials_->weigh(out_.base);
    score_all();
  }

  void score_all(double progress = 0.45) {
    tell(progress, "Scoring all causes");
    out_.first = analyse(study_, out_.base_state, out_.slopes, out_.spread, out_.noise,
                         out_.slopes.prediction, 0.0, options_.analysis);
    if (!knows_the_solver()) return;
    Linearised held = out_.slopes;
    hold_corrections(study_.model(), out_.base_state, held.prediction, held.theta);
    const Analysis exact = analyse(study_, out_.base_state, held, Spread::none(study_.size()),
                                   out_.noise, held.prediction, 0.0, options_.analysis);
    double largest = 0.0;
    for (const Score& score : exact.scores) largest = std::max(largest, score.equivalent);
    out_.exact_solver_significant = exact.smooth.p < 0.01 || exact.placebo.p(largest) < 0.01;
  }

  [[nodiscard]] bool knows_the_solver() const {
    return members_ > 0 && study_.model().has_numerics();
  }

  /// χ² that a refit leaves if the solver is exact, without its bias and once the refit's numbers
  /// have adapted to first order.
  [[nodiscard]] double left_if_exact(const Refit& refit) const {
    const Index used = study_.used().size();
    const Whitening plain(
        study_.used(), out_.noise,
        solver_columns(study_.used(), study_.model().captures(), Spread::none(used)).values);
    VectorXd prediction = refit.prediction;
    if (refitter_->bias().size() > 0) prediction -= refit.bias * refitter_->bias();
    const VectorXd residual = plain.apply((study_.measured() - prediction).head(used));
    const MatrixXd slopes = plain.apply(refit.slopes.topRows(used));
    return (residual - slopes * slopes.colPivHouseholderQr().solve(residual)).squaredNorm();
  }

  /// Where the base is far off, what it lacks has pulled the material along, and a cause's own
  /// first estimate from there is of another motion. With the best few causes at once the search
  /// comes nearer to what it was, and each cause may begin there by itself.
  void fit_together() {
    together_.reset();
    if (looseness_of(out_.base.refit) < kFarOff) return;
    const std::vector<Score>& scores = out_.first->scores;
    std::vector<std::size_t> chosen;
    for (const std::size_t k : best_shapes(scores)) {
      if (chosen.size() >= kTogether) break;
      const Score& score = scores[k];
      if (!effect_of(score).onsets.empty()) continue;
      if (out_.first->placebo.p(score.equivalent) >= options_.analysis.placebo.level) break;
      const bool alike = std::ranges::any_of(chosen, [&](std::size_t other) {
        return out_.first->test.imitation(other, scores[other].estimate, k) > kAlike;
      });
      if (!alike) chosen.push_back(k);
    }
    if (chosen.size() < 2) return;
    tell(0.48, fmt::format("Refitting with {} causes together", chosen.size()));
    study_.begin("refits");
    RefitStart start{{out_.base_state}, out_.slopes.theta};
    for (const std::size_t k : chosen) {
      const Score& score = scores[k];
      start.states.front() =
          extended(study_.model(), start.states.front(), score.candidate, score.estimate, 0.0);
      start.slopes = beside(start.slopes, columns_of(out_.slopes, score.candidate));
    }
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
      attempts.push_back({trial.causes, {std::move(states), {}}});
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
    const std::vector<std::size_t> order = best_shapes(scores);
    if (order.empty()) return;
    const Score& top = scores[order.front()];
    std::vector<Attempt> attempts;
    add_onsets(scores, known, attempts);
    if (out_.first->placebo.p(top.equivalent) < options_.analysis.placebo.level) {
      for (const Score& score : scores) {
        if (effect_of(score).tries.empty()) continue;
        attempts.push_back({{score.candidate}, single_start(score, known)});
      }
    }
    const std::size_t set = attempts.size();
    for (const std::size_t k : order) {
      if (int(attempts.size() - set) >= options_.refits) break;
      const Score& score = scores[k];
      if (!effect_of(score).onsets.empty() || !effect_of(score).tries.empty()) continue;
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
        study_.begin("refits");
        at->second = fitted_before(study_, out_.noise, out_.spread, out_.base_state,
                                   out_.slopes.theta, onset, options_.refit);
      }
      attempts.push_back(
          {{score.candidate},
           at->second ? onset_start(score, *at->second) : single_start(score, known)});
    }
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
    if (Trial* trial = known_of(score, known)) {
      return {{trial->refit.state}, std::move(trial->refit.slopes)};
    }
    RefitStart start{
        {extended(study_.model(), out_.base_state, score.candidate, score.estimate, 1.0),
         extended(study_.model(), out_.base_state, score.candidate, score.estimate, 0.5)},
        beside(out_.slopes.theta, columns_of(out_.slopes, score.candidate))};
    const Effect& effect = effect_of(score);
    for (const double value : effect.tries) {
      VectorXd there = VectorXd::Zero(score.estimate.size());
      there[0] = (value - effect.numbers[0].neutral) / effect.numbers[0].scale;
      start.states.push_back(
          extended(study_.model(), out_.base_state, score.candidate, there, 1.0));
      start.slopes.resize(0, 0);
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
    out_.best = out_.singles.front();
    out_.looseness = looseness_of(out_.best->refit);
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
    // Nor is one that a cause whose number is known well takes away nearly all of (or most of,
    // where it takes half as much as the solver's whole covariance), and takes from what was kept
    // back too: the solver's errors are not one cause's signature.
    const Refit& before = out_.base.refit;
    const double left = knows_the_solver() ? left_if_exact(before) : 0.0;
    const double solver_took = std::max(0.0, left - before.chi_square);
    const double cause_took = knows_the_solver() ? left - left_if_exact(out_.best->refit) : 0.0;
    const double explained = share_of_excess(before, out_.best->refit);
    const bool large =
        explained > kNearlyAll || (looseness_of(before) > kFarOff && explained > kMostly &&
                                   cause_took > kAsTheSolver * solver_took);
    const bool accounts = large && told_by(out_.best->refit) > kSure &&
                          kept_back - out_.best->opinion.deviance > kExcluded * out_.looseness;
    out_.within_solver = out_.exact_solver_significant && !(g.measurable && predicts) &&
                         !accounts &&
                         out_.base.evidence - out_.best->evidence < kExtrapolated * solver_took;
    out_.accepted = predicts && likelier && told_by(out_.best->refit) > kTold &&
                    !out_.best->refit.at_bound && !out_.within_solver;
    for (std::size_t k = 0; k < out_.first->scores.size(); ++k) {
      if (is_rival(out_.first->scores[k])) out_.rivals.push_back(k);
    }
  }

  /// By how many standard errors each cause has a number that is beyond its neutral value.
  [[nodiscard]] double told_by(const Refit& refit) const {
    const double wide = std::sqrt(looseness_of(refit));
    double least = 1e300;
    Index at = 0;
    for (const Active& cause : refit.state.causes) {
      const std::vector<Number>& numbers =
          study_.model().effects()[std::size_t(cause.effect)].numbers;
      double most = 0.0;
      for (Index k = 0; k < cause.values.size(); ++k, ++at) {
        const double beyond = std::abs(cause.values[k] - numbers[std::size_t(k)].neutral);
        most = std::max(most, beyond / std::max(wide * refit.error[at], 1e-300));
      }
      least = std::min(least, most);
    }
    return least;
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
  std::map<double, std::optional<State>> before_onset_;  ///< by the time
  std::optional<State> together_;  ///< the base with the best few causes at once
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
