// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/approach.hpp"

#include <utility>
#include <vector>

#include "diagnose/analysis.hpp"
#include "diagnose/places.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// The smallest deviation that counts as noise: rounding of single precision at a metre.
constexpr double kNoiseFloor = 1e-7;
/// Root mean square of what fitted values leave, in the noise that captures state, beyond which a
/// fit has gone astray. (An estimate of the noise takes up what is left.)
constexpr double kAstray = 4.0;

bool is_astray(const Study& study, const VectorXd& left) {
  double sum = 0.0;
  Index rows = 0;
  for (const Series& series : study.used().series()) {
    const double noise = study.model().captures()[std::size_t(series.capture)].noise;
    if (!(noise > 0.0)) continue;
    const Index count = series.end - series.begin;
    sum += left.segment(series.begin, count).squaredNorm() / (noise * noise);
    rows += count;
  }
  return sum > kAstray * kAstray * double(rows);
}

}  // namespace

Noise noise_left(const Study& study, const VectorXd& stacked, const Linearised& slopes,
                 const Spread& spread) {
  const Index used = study.used().size();
  const std::vector<Capture>& captures = study.model().captures();
  return estimate_noise(study.used(), captures, stacked.head(used),
                        explained_columns(study, slopes, spread, stacked.head(used)), kNoiseFloor,
                        body_turns(study.used(), captures, slopes.prediction.head(used)));
}

Approach come_near(const Study& study, const State& state, const RefitOptions& options) {
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
  if (is_astray(study, left)) {
    for (VectorXd& theta : study.model().other_starts()) {
      if (theta != state.theta) start.states.push_back({std::move(theta), state.causes});
    }
  }
  Refit refit = refitter.fit(std::move(start));
  return {std::move(refit.state), refit.began > 0};
}

}  // namespace matterfit::diagnose
