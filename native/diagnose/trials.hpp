// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <map>
#include <string>
#include <vector>

#include "diagnose/judge.hpp"
#include "diagnose/refit.hpp"
#include "diagnose/study.hpp"

namespace matterfit::diagnose {

/// 100 : 1 in likelihood: a rival with a χ² that much larger is excluded.
inline constexpr double kExcluded = 9.2;

/// χ² is counted in numbers of causes at this price each.
inline constexpr double kPrice = 2.0;

/// A model that was tried.
struct Trial {
  std::vector<Candidate> causes;  ///< empty: nothing added
  Refit refit;
  Judge::Opinion opinion;
  Gain gain;                 ///< over nothing added
  int numbers = 0;           ///< that the causes have
  double corrections = 1.0;  ///< Refitter::Corrections::size
  /// −2 ln of its evidence: χ² and priors of what was fitted, χ² of what was held out (over the
  /// base's looseness there), and 2 for each number of its causes (Akaike 1974). Smaller is
  /// better.
  double evidence = 0.0;
  /// χ² of used and held-out rows by block, for how far blocks agree on which model is better.
  std::map<BlockKey, double> blocks;
};

/// Causes to be tried, and where their search begins.
struct Attempt {
  std::vector<Candidate> causes;
  RefitStart start;
};

/// χ²/dof, at least 1.
[[nodiscard]] double looseness_of(const Refit& refit);
/// Looseness above which a model is far off.
inline constexpr double kFarOff = 1.2;

/// Share of a base's χ² beyond its freedom that another refit takes away; below 0 where that is
/// worse.
[[nodiscard]] double share_of_excess(const Refit& base, const Refit& refit);

/// Whether `worse` is excluded by `good`: 100 : 1 in likelihood, and where even the good model
/// leaves more than noise, so that likelihoods under that noise mean little, blocks must agree as
/// well: the mean of ln(χ²_worse/χ²_good) over blocks, each with an error of its own size,
/// against its spread (after Vuong 1989).
[[nodiscard]] bool excludes(const Trial& good, const Trial& worse);

/// Whether `trial` explains less than half of the excess that `good` does and predicts less than
/// half of what that predicts (gains over `base`; where they can be measured): so little is no
/// rival of it, whatever likelihoods say that mean little.
[[nodiscard]] bool falls_short(const Trial& base, const Trial& good, const Trial& trial);

/// Moves to the front the trial that is best when each number is paid for twice, among those whose
/// evidence is within kExcluded of the first's: chance makes a vector fit a little better than its
/// size. `trials` are one at least, in the order of their evidence.
void put_simplest_first(std::vector<Trial>& trials);

/// Refits under one covariance and judges what they predict of what was kept back.
class Trials {
 public:
  /// All must outlive this.
  Trials(const Study& study, const Refitter& refitter, const Judge& judge)
      : study_(study), refitter_(refitter), judge_(judge) {}

  /// Those that can be simulated, in order, refitted side by side; their simulations count as
  /// `stage`.
  [[nodiscard]] std::vector<Trial> tried(std::vector<Attempt> attempts,
                                         const std::string& stage) const;
  /// Refitter::spent(); marks the study as cut if so.
  [[nodiscard]] bool cut() const {
    if (!refitter_.spent()) return false;
    study_.mark_cut();
    return true;
  }
  /// Sets evidence, corrections and blocks from the refit and the opinion.
  void weigh(Trial& trial) const;
  /// Held-out samples count by what the base leaves of them from now on: where errors there are
  /// larger than their covariance says, differences between models are so as well.
  void temper(const Trial& base);
  /// Whether `more` is worth its causes over `fewer`.
  [[nodiscard]] bool better(const Trial& fewer, const Trial& more) const;

 private:
  const Study& study_;
  const Refitter& refitter_;
  const Judge& judge_;
  double held_looseness_ = 1.0;
};

}  // namespace matterfit::diagnose
