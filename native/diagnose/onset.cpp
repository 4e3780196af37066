// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/onset.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "diagnose/judge.hpp"

namespace matterfit::diagnose {

using Eigen::Index;

std::optional<State> fitted_before(const Study& study, const Noise& noise, const Spread& spread,
                                   const State& state, const Eigen::MatrixXd& slopes, double onset,
                                   const RefitOptions& options) {
  // Three frames tell a velocity from an acceleration.
  constexpr std::size_t kFewestFrames = 3;
  // Standard errors.
  constexpr double kMoved = 2.0;
  std::set<std::pair<int, Index>> frames;
  for (const Series& s : study.used().series()) {
    for (Index i = s.begin; i < s.end; ++i) {
      if (study.used().time(i) < onset) frames.insert({s.capture, study.used().frame(i)});
    }
  }
  if (frames.size() < kFewestFrames) return std::nullopt;
  Rows early = study.used_in([&](int c, Index frame) { return frames.contains({c, frame}); });
  Rows nothing = study.used_in([](int, Index) { return false; });
  const std::vector<Index> places = places_in(study.used(), early);
  const Study before(study, std::move(early), std::move(nothing));
  const Refitter refitter(before, for_rows(noise, before.used()), spread.at(places), options);
  const Eigen::MatrixXd early_slopes = slopes(places, Eigen::all);
  std::vector<RefitStart> starts;
  starts.push_back({{state}, early_slopes});
  const auto refit = std::move(refitter.fit_all(std::move(starts)).front());
  if (!refit) return std::nullopt;
  // What so little does not tell stays as it was: a stiffness, say, before anything was touched.
  // The slopes are those at `state`: the search's took steps apart by what they surprised with.
  State result = refit->state;
  const Eigen::MatrixXd white = refitter.whitening().apply(early_slopes);
  Eigen::MatrixXd h = white.transpose() * white;
  const Eigen::VectorXd known = theta_prior(study.model(), noise.corrections).precision;
  h.diagonal().head(known.size()) += known;
  const Eigen::VectorXd variance = variances_of(std::move(h));
  for (Index p = 0; p < result.theta.size(); ++p) {
    const double scale = study.model().parameters()[std::size_t(p)].scale;
    const double moved = (result.theta[p] - state.theta[p]) / scale;
    if (moved * moved < kMoved * kMoved * variance[p]) result.theta[p] = state.theta[p];
  }
  return result;
}

}  // namespace matterfit::diagnose
