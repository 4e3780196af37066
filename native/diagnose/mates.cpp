// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/mates.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cstddef>
#include <utility>

#include "diagnose/starts.hpp"

namespace matterfit::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::vector<Candidate> mates_of(const Model& model, const std::vector<Score>& scores,
                                const Candidate& cause, const std::vector<int>& known,
                                double share) {
  const auto own = std::ranges::find(scores, cause, &Score::candidate);
  const double least = own == scores.end() ? 0.0 : share * own->statistic;
  const std::vector<std::string>& names = model.effects()[std::size_t(cause.effect)].confused_with;
  std::vector<Candidate> result;
  for (const std::size_t k : best_shapes(scores)) {
    const Candidate& candidate = scores[k].candidate;
    const std::string& name = model.effects()[std::size_t(candidate.effect)].name;
    if (std::ranges::count(known, candidate.effect) > 0) continue;
    if (scores[k].statistic < least || !stands(model, candidate, {})) continue;
    if (std::ranges::count(names, name) > 0) result.push_back(candidate);
  }
  return result;
}

std::vector<std::pair<Candidate, RefitStart>> starts_beside(
    const Study& study, const Whitening& whitening, const Refit& good,
    const std::vector<Candidate>& candidates, DifferenceOptions options) {
  const State plain{good.state.theta, {}};
  if (candidates.empty() || !study.motions({plain}, Study::Wanted::kUsed).front()) return {};
  for (Index p = 0; p < plain.theta.size(); ++p) options.left_out.push_back(p);
  options.wanted = Study::Wanted::kUsed;
  const Linearised slopes = linearise(study, plain, candidates, options);
  const Index used = study.used().size();
  const VectorXd changed = whitening.apply((good.prediction - slopes.prediction).head(used));
  std::vector<std::pair<Candidate, RefitStart>> starts;
  for (const Candidate& candidate : candidates) {
    const MatrixXd& columns = columns_of(slopes, candidate);
    if (columns.cols() == 0) continue;
    const MatrixXd white = whitening.apply(columns.topRows(used));
    const VectorXd estimate = white.completeOrthogonalDecomposition().solve(changed);
    RefitStart start;
    for (const double share : {1.0, 2.0, 0.5}) {
      start.states.push_back(extended(study.model(), plain, candidate, estimate, share));
    }
    starts.emplace_back(candidate, std::move(start));
  }
  return starts;
}

}  // namespace matterfit::diagnose
