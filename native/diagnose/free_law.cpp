// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/free_law.hpp"

#include <algorithm>
#include <utility>

#include "diagnose/extend.hpp"
#include "diagnose/starts.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;

/// p of the smooth residual below which something is left to be explained.
constexpr double kSomethingLeft = 0.01;

std::optional<Candidate> last_of(const Model& model) {
  const auto found = std::ranges::find_if(model.effects(), &Effect::last);
  if (found == model.effects().end()) return std::nullopt;
  return Candidate{int(found - model.effects().begin()), 0};
}

/// Whether the free law beside `without` is worth its numbers there and in what was kept back.
bool worth(const Trials& trials, const Trial& without, const Trial& with, const Trial& base) {
  const double limit = kExcluded * looseness_of(with.refit);
  const bool likelier = without.evidence - with.evidence > limit && trials.better(without, with);
  const Gain& gain = with.gain;
  const double before = &without == &base ? 0.0 : without.gain.value;
  const bool predicts = gain.measurable ? gain.low > 0.0 && gain.value > before
                                        : with.opinion.deviance < without.opinion.deviance - kPrice;
  return likelier && predicts && !with.refit.at_bound;
}

}  // namespace

std::optional<FreeLaw> free_law(const Study& study, const Trials& trials, const Judge& judge,
                                const ExtendOptions& options, const Extension& found) {
  const std::optional<Candidate> law = last_of(study.model());
  if (!law || trials.cut()) return std::nullopt;
  if (options.progress) options.progress(0.95, "Looking at what a free law would explain");
  study.begin("free law");
  DifferenceOptions differences = options.refit.differences;
  for (Index p = 0; p < found.base_state.theta.size(); ++p) differences.left_out.push_back(p);
  const Linearised freed = linearise(study, found.base_state, {*law}, differences);
  if (freed.columns.empty() || freed.columns.front().values.cols() == 0) return std::nullopt;

  Linearised slopes = found.slopes;
  slopes.columns.push_back(freed.columns.front());
  const Analysis beside_all = analyse(study, found.base_state, slopes, found.spread, found.noise,
                                      slopes.prediction, 0.0, options.analysis);
  FreeLaw result;
  result.candidate = *law;
  const std::size_t own = beside_all.scores.size() - 1;
  result.score = beside_all.scores[own];
  result.p = beside_all.placebo.p(result.score.equivalent);
  for (std::size_t k = 0; k < found.first->scores.size(); ++k) {
    const Score& score = found.first->scores[k];
    const bool seen = score.observable && result.score.observable;
    result.absorbed.push_back(seen ? beside_all.test.imitation(k, score.estimate, own) : 0.0);
  }

  const Trial& without = found.accepted ? *found.best : found.base;
  // Where nothing was accepted the score of the law itself says whether there is anything for it.
  const bool left = found.accepted ? found.last && found.last->smooth.p < kSomethingLeft
                                   : result.p < options.analysis.placebo.level;
  if (!result.score.observable || found.within_solver || !left) return result;
  Attempt attempt;
  attempt.causes = without.causes;
  attempt.causes.push_back(*law);
  for (const double share : {1.0, 0.5, 0.0}) {
    attempt.start.states.push_back(
        extended(study.model(), without.refit.state, *law, result.score.estimate, share));
  }
  const Eigen::MatrixXd& known = without.refit.slopes;
  attempt.start.slopes =
      beside(known.rows() > 0 ? known : found.slopes.theta, freed.columns.front().values);
  attempt.start.corrections = without.corrections;
  std::vector<Attempt> attempts;
  attempts.push_back(std::move(attempt));
  std::vector<Trial> tried = trials.tried(std::move(attempts), "free law");
  if (tried.empty()) return result;
  result.trial = std::move(tried.front());
  result.trial->gain =
      judge.gain_of(found.base.opinion, result.trial->opinion, result.trial->numbers, options.gain);
  result.improves = worth(trials, without, *result.trial, found.base);
  return result;
}

}  // namespace matterfit::diagnose
