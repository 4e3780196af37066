// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/trials.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "diagnose/gain.hpp"
#include "fit/numerics/student.hpp"

namespace matterfit::diagnose {

using Eigen::VectorXd;

namespace {

/// χ²/dof from which the best model counts as inadequate: its errors are then not noise.
constexpr double kInadequate = 1.5;
/// Standard errors by which blocks must agree: 100 : 1, one-sided.
constexpr double kAgreement = 2.33;

}  // namespace

double looseness_of(const Refit& refit) { return std::max(1.0, refit.chi_square / refit.freedom); }

double share_of_excess(const Refit& base, const Refit& refit) {
  return (base.chi_square - refit.chi_square) / std::max(base.chi_square - base.freedom, 1.0);
}

bool excludes(const Trial& good, const Trial& worse) {
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

bool falls_short(const Trial& base, const Trial& good, const Trial& trial) {
  constexpr double kHalf = 0.5;
  if (!good.gain.measurable || !trial.gain.measurable) return false;
  return trial.gain.value < kHalf * good.gain.value &&
         share_of_excess(base.refit, trial.refit) < kHalf * share_of_excess(base.refit, good.refit);
}

void put_simplest_first(std::vector<Trial>& trials) {
  const Trial& first = trials.front();
  const double limit = first.evidence + kExcluded * looseness_of(first.refit);
  const auto best = std::ranges::min_element(trials, {}, [&](const Trial& trial) {
    return trial.evidence < limit ? trial.evidence + kPrice * trial.numbers
                                  : std::numeric_limits<double>::infinity();
  });
  std::rotate(trials.begin(), best, std::next(best));
}

std::vector<Trial> Trials::tried(std::vector<Attempt> attempts, const std::string& stage) const {
  study_.begin_search(stage);
  std::vector<RefitStart> starts;
  starts.reserve(attempts.size());
  for (Attempt& attempt : attempts) starts.push_back(std::move(attempt.start));
  std::vector<std::optional<Refit>> refits = refitter_.fit_all(std::move(starts));
  std::vector<Trial> trials;
  trials.reserve(attempts.size());
  for (std::size_t i = 0; i < attempts.size(); ++i) {
    if (!refits[i]) continue;
    Trial& trial = trials.emplace_back();
    trial.causes = std::move(attempts[i].causes);
    trial.refit = std::move(*refits[i]);
    for (const Candidate& candidate : trial.causes) {
      trial.numbers += int(study_.model().effects()[std::size_t(candidate.effect)].numbers.size());
    }
  }
  std::vector<const Refit*> models;
  models.reserve(trials.size());
  for (const Trial& trial : trials) models.push_back(&trial.refit);
  study_.begin("held-out");
  std::vector<Judge::Opinion> opinions = judge_.judge(models);
  for (std::size_t i = 0; i < trials.size(); ++i) {
    trials[i].opinion = std::move(opinions[i]);
    weigh(trials[i]);
  }
  return trials;
}

void Trials::weigh(Trial& trial) const {
  const Refitter::Corrections corrections = refitter_.corrections_of(trial.refit);
  trial.corrections = corrections.size;
  trial.evidence = trial.refit.deviance + corrections.term +
                   trial.opinion.deviance / held_looseness_ + kPrice * trial.numbers;
  const VectorXd white = refitter_.whitening().apply(
      (study_.measured() - trial.refit.prediction).head(study_.used().size()));
  trial.blocks = trial.opinion.blocks;
  add_by_block(study_.used(), study_.model().captures(), white, trial.blocks);
}

void Trials::temper(const Trial& base) {
  const double rows = double(judge_.rows().size());
  if (rows > 0.0) held_looseness_ = std::max(1.0, base.opinion.deviance / rows);
}

bool Trials::better(const Trial& fewer, const Trial& more) const {
  if (!excludes(more, fewer)) return false;
  const double before = root_mean_square(judge_.rows(), fewer.opinion.residual);
  const double after = root_mean_square(judge_.rows(), more.opinion.residual);
  // Unseen samples may not get worse by more than a hundredth.
  return after <= 1.01 * before;
}

}  // namespace matterfit::diagnose
