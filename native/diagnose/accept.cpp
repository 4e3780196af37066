// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/accept.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "diagnose/starts.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The solver's error is extrapolated to first order: a tenth of the χ² it stands for, a third of
/// its size, may be the next order's.
constexpr double kExtrapolated = 0.1;
/// Standard errors by which a number of an accepted cause is beyond its neutral value.
constexpr double kTold = 2.0;
/// The same for a cause that leaves nothing to the solver.
constexpr double kSure = 5.0;
/// Share of the excess that such a cause explains at least.
constexpr double kNearlyAll = 0.6;
/// The same of one that takes away as much as this share of what the solver's error explains where
/// the cause is not there.
constexpr double kMostly = 0.5;
constexpr double kAsTheSolver = 0.5;
/// A cause that is itself an acceleration field predicts what the free field does, to rounding;
/// where both leave less than noise and the solver make, neither is the better one.
constexpr double kAsGood = 1.02;

class Acceptance {
 public:
  Acceptance(const Study& study, const Refitter& refitter, const Judge& judge,
             const ExtendOptions& options, Extension& out)
      : study_(study), refitter_(refitter), judge_(judge), options_(options), out_(out) {}

  void run() {
    for (Trial& trial : out_.singles) {
      trial.gain = judge_.gain_of(out_.base.opinion, trial.opinion, trial.numbers, options_.gain);
    }
    out_.base.gain = judge_.gain_of(out_.base.opinion, out_.base.opinion, 1, options_.gain);
    if (!out_.best) return;
    out_.best->gain =
        judge_.gain_of(out_.base.opinion, out_.best->opinion, out_.best->numbers, options_.gain);
    const Gain& g = out_.best->gain;
    const double kept_back = out_.base.opinion.deviance;
    const bool forecasts = predicts(g, out_.base.opinion, out_.best->opinion, out_.best->numbers);
    const bool likelier = out_.base.evidence - out_.best->evidence > kExcluded * out_.looseness;
    // An error that is beyond what solver and noise make, and that the cause takes away, is not the
    // solver's.
    // Nor is one that a cause whose number is known well takes away nearly all of (or most of,
    // where it takes half as much as the solver's whole covariance), and takes from what was kept
    // back too: the solver's errors are not one cause's signature.
    const Refit& before = out_.base.refit;
    const double left = out_.spread.known() ? left_if_exact(before) : 0.0;
    const double solver_took = std::max(0.0, left - before.chi_square);
    const double cause_took = out_.spread.known() ? left - left_if_exact(out_.best->refit) : 0.0;
    const double explained = share_of_excess(before, out_.best->refit);
    const bool large =
        explained > kNearlyAll || (looseness_of(before) > kFarOff && explained > kMostly &&
                                   cause_took > kAsTheSolver * solver_took);
    const bool accounts = large && told_by(out_.best->refit) > kSure &&
                          kept_back - out_.best->opinion.deviance > kExcluded * out_.looseness;
    out_.within_solver = out_.exact_solver_significant && !(g.measurable && forecasts) &&
                         !accounts &&
                         out_.base.evidence - out_.best->evidence < kExtrapolated * solver_took;
    out_.accepted = forecasts && likelier && told_by(out_.best->refit) > kTold &&
                    !out_.best->refit.at_bound && !out_.within_solver;
    for (std::size_t k = 0; k < out_.first->scores.size(); ++k) {
      if (is_rival(out_.first->scores[k])) out_.rivals.push_back(k);
    }
  }

 private:
  /// χ² that a refit leaves if the solver is exact, without its bias and once the refit's numbers
  /// have adapted to first order.
  [[nodiscard]] double left_if_exact(const Refit& refit) const {
    const Index used = study_.used().size();
    const Whitening plain(
        study_.used(), out_.noise,
        solver_columns(study_.used(), study_.model().captures(), Spread::none(used)).values);
    VectorXd prediction = refit.prediction;
    if (refitter_.bias().size() > 0) prediction -= refit.bias * refitter_.bias();
    const VectorXd residual = plain.apply((study_.measured() - prediction).head(used));
    const MatrixXd slopes = plain.apply(refit.slopes.topRows(used));
    return (residual - slopes * slopes.colPivHouseholderQr().solve(residual)).squaredNorm();
  }

  /// The standard errors by which each cause has a number beyond its neutral value.
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
    if (!score.observable || !stands(study_.model(), score.candidate, {})) return false;
    const Trial& best = out_.singles.front();
    // The best may be a simpler cause that is only nearly as likely.
    const Trial& likeliest = *std::ranges::min_element(out_.singles, {}, &Trial::evidence);
    const double limit = kExcluded * looseness_of(best.refit);
    for (const Trial& trial : out_.singles) {
      if (trial.causes.front().effect != score.candidate.effect) continue;
      return trial.causes.front().variant == score.candidate.variant && !trial.refit.at_bound &&
             !excludes(likeliest, trial) && !falls_short(out_.base, best, trial);
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
  const Refitter& refitter_;
  const Judge& judge_;
  const ExtendOptions& options_;
  Extension& out_;
};

}  // namespace

bool predicts(const Gain& gain, const Judge::Opinion& without, const Judge::Opinion& with,
              int numbers) {
  if (gain.measurable) {
    return gain.low > 0.0 && gain.after < gain.last_residual &&
           gain.after <= std::max(kAsGood * gain.free_field, gain.floor);
  }
  if (without.deviance > 0.0) return without.deviance - with.deviance > kPrice * numbers;
  return gain.after <= 1.05 * gain.before;
}

void accept(const Study& study, const Refitter& refitter, const Judge& judge,
            const ExtendOptions& options, Extension& out) {
  Acceptance(study, refitter, judge, options, out).run();
}

}  // namespace matterfit::diagnose
