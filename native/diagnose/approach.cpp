// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/approach.hpp"

#include <utility>
#include <vector>

#include "diagnose/analysis.hpp"
#include "diagnose/places.hpp"
#include "diagnose/whitening.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// The smallest deviation that counts as noise: rounding of single precision at a metre.
constexpr double kNoiseFloor = 1e-7;
/// χ² a row beyond which fitted values are far off.
constexpr double kAstray = 9.0;

}  // namespace

Noise noise_left(const Study& study, const VectorXd& stacked, const Linearised& slopes,
                 const Spread& spread) {
  const Index used = study.used().size();
  const std::vector<Capture>& captures = study.model().captures();
  return estimate_noise(study.used(), captures, stacked.head(used),
                        explained_columns(study, slopes, spread), kNoiseFloor,
                        body_turns(study.used(), captures, slopes.prediction.head(used)));
}

State come_near(const Study& study, const State& state, const RefitOptions& options) {
  DifferenceOptions differences = options.differences;
  differences.wanted = Study::Wanted::kUsed;
  const Linearised slopes = linearise(study, state, {}, differences);
  const VectorXd left = study.measured() - slopes.prediction;
  const Spread exact = Spread::none(study.size());
  const Refitter refitter(study, noise_left(study, left, slopes, exact), exact, options);
  RefitStart start{{state}, slopes.theta};
  start.made_there = true;
  start.whole = true;
  start.rough = true;
  const Index used = study.used().size();
  const double chi_square = refitter.whitening().apply(left.head(used)).squaredNorm();
  if (chi_square > kAstray * double(used)) {
    for (VectorXd& theta : study.model().other_starts()) {
      start.states.push_back({std::move(theta), state.causes});
    }
  }
  if (start.states.size() > 1) {
    start.made_there = false;
    start.renew = true;
    // What flights between impacts do hardly depends on where a fit has ended.
    start.whole = false;
  }
  return refitter.fit(std::move(start)).state;
}

}  // namespace matterfit::diagnose
