// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/judge.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <utility>

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Kept back where nothing was held out: the last quarter of a clip's used frames.
constexpr double kEarlyShare = 0.75;

/// (JᵀJ + Λ)^−½ up to a rotation, JᵀJ whitened: columns of J times it are what errors of θ move.
MatrixXd root_of_covariance(const MatrixXd& white, const VectorXd& precision) {
  MatrixXd h = white.transpose() * white;
  h.diagonal() += precision;
  const MatrixXd lower = regularised(std::move(h)).llt().matrixL();
  return lower.transpose().triangularView<Eigen::Upper>().solve(
      MatrixXd::Identity(lower.cols(), lower.cols()));
}

}  // namespace

std::vector<Index> places_in(const Rows& from, const Rows& to) {
  std::map<std::tuple<int, Index, int, Index>, Index> place;
  for (const Series& s : from.series()) {
    for (Index i = s.begin; i < s.end; ++i) place[{s.capture, s.track, s.axis, from.frame(i)}] = i;
  }
  std::vector<Index> result;
  result.reserve(std::size_t(to.size()));
  for (const Series& s : to.series()) {
    for (Index i = s.begin; i < s.end; ++i) {
      result.push_back(place.at({s.capture, s.track, s.axis, to.frame(i)}));
    }
  }
  return result;
}

Judge::Judge(const Study& study, const Noise& noise, const Spread& spread, const MatrixXd& theta,
             const RefitOptions& options)
    : study_(&study), differences_(options.differences) {
  const Model& model = study.model();
  Spread solver = spread;
  theta_ = theta;
  if (study.held().size() == 0) {
    std::vector<std::set<Index>> frames(model.captures().size());
    for (const Series& s : study.used().series()) {
      for (Index i = s.begin; i < s.end; ++i) {
        frames[std::size_t(s.capture)].insert(study.used().frame(i));
      }
    }
    std::vector<Index> cut(frames.size(), 0);
    for (std::size_t c = 0; c < frames.size(); ++c) {
      if (frames[c].empty()) continue;
      const auto early = std::ptrdiff_t(kEarlyShare * double(frames[c].size()));
      cut[c] = *std::next(frames[c].begin(), std::min(early, std::ptrdiff_t(frames[c].size() - 1)));
    }
    const auto part = [&](bool later) {
      return study.used_in(
          [&](int c, Index frame) { return (frame >= cut[std::size_t(c)]) == later; });
    };
    split_ = std::make_unique<Study>(study, part(false), part(true));
    places_ = places_in(study.used(), split_->used());
    const std::vector<Index> later = places_in(study.used(), split_->held());
    places_.insert(places_.end(), later.begin(), later.end());
    solver = spread.at(places_);
    theta_ = theta(places_, Eigen::all);
    study_ = split_.get();
    fit_noise_ = for_rows(noise, split_->used());
    refitter_ = std::make_unique<Refitter>(*split_, fit_noise_, solver, options);
  } else {
    fit_noise_ = noise;
    const std::vector<int> own = model.own_capture();
    std::vector<bool> used(model.captures().size(), false);
    for (const Series& s : study.used().series()) used[std::size_t(s.capture)] = true;
    for (std::size_t p = 0; p < own.size(); ++p) {
      if (own[p] >= 0 && !used[std::size_t(own[p])]) own_.push_back(Index(p));
    }
  }
  const Index fitted = study_->used().size();
  const Index held = study_->held().size();
  held_noise_ = for_rows(noise, study_->held());
  const Spread held_spread = solver.bottom(held);
  held_solver_ = held_spread.deviations();
  const std::vector<Capture>& captures = model.captures();
  used_whitening_.emplace(study_->used(), fit_noise_,
                          solver_columns(study_->used(), captures, solver.top(fitted)).values);
  const MatrixXd own = solver_columns(study_->held(), captures, held_spread).values;
  // Own parameters are fitted to the held-out samples; the others err as the fit says.
  MatrixXd columns = theta_;
  for (const Index p : own_) columns.col(p).setZero();
  const VectorXd precision = theta_prior(model, noise.corrections).precision;
  const MatrixXd moved =
      columns.bottomRows(held) *
      root_of_covariance(used_whitening_->apply(columns.topRows(fitted)), precision);
  MatrixXd columns_of_errors(held, own.cols() + moved.cols());
  columns_of_errors << own, moved;
  if (held > 0) whitening_.emplace(study_->held(), held_noise_, columns_of_errors);
}

State Judge::settle(const State& state) const {
  State here = state;
  if (own_.empty()) return here;
  const auto& parameters = study_->model().parameters();
  const Index held = study_->held().size();
  constexpr int kIterations = 4;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    std::vector<State> states{here};
    for (const Index p : own_) {
      states.push_back(here);
      states.back().theta[p] += differences_.step * parameters[std::size_t(p)].scale;
    }
    const auto runs = study_->predict(states);
    if (!runs[0]) return here;
    MatrixXd slopes = MatrixXd::Zero(held, Index(own_.size()));
    for (std::size_t k = 0; k < own_.size(); ++k) {
      if (!runs[k + 1]) continue;
      slopes.col(Index(k)) = (*runs[k + 1] - *runs[0]).tail(held) / differences_.step;
    }
    const MatrixXd white = whitening_->apply(slopes);
    const VectorXd residual = whitening_->apply((study_->measured() - *runs[0]).tail(held));
    MatrixXd h = white.transpose() * white;
    h.diagonal() *= 1.0 + 1e-9;
    h.diagonal().array() += 1e-300;
    const VectorXd step = h.ldlt().solve(white.transpose() * residual);
    for (std::size_t k = 0; k < own_.size(); ++k) {
      const fit::Parameter& parameter = parameters[std::size_t(own_[k])];
      here.theta[own_[k]] = std::clamp(here.theta[own_[k]] + step[Index(k)] * parameter.scale,
                                       fit::to_natural(parameter.coordinate, parameter.low),
                                       fit::to_natural(parameter.coordinate, parameter.high));
    }
    // Far below any error that is reported.
    if (step.cwiseAbs().maxCoeff() < 1e-6) break;
  }
  return here;
}

std::vector<VectorXd> Judge::predictions(std::span<const Refit* const> refits) const {
  std::vector<VectorXd> result;
  result.reserve(refits.size());
  for (const Refit* refit : refits) result.push_back(refit->prediction);
  if (refitter_) {
    std::vector<RefitStart> starts;
    starts.reserve(refits.size());
    for (const Refit* refit : refits) {
      starts.push_back({{refit->state}, refit->slopes(places_, Eigen::all)});
      starts.back().corrections = refit->corrections;
    }
    const auto again = refitter_->fit_all(std::move(starts));
    for (std::size_t i = 0; i < refits.size(); ++i) {
      result[i] = again[i] ? again[i]->prediction : VectorXd(result[i](places_));
    }
  } else if (!own_.empty()) {
    for (std::size_t i = 0; i < refits.size(); ++i) {
      // The bias of the grid stays as it was.
      const State& state = refits[i]->state;
      const auto runs = study_->predict({settle(state), state});
      if (runs[0] && runs[1]) result[i] += *runs[0] - *runs[1];
    }
  }
  return result;
}

std::vector<Judge::Opinion> Judge::judge(std::span<const Refit* const> refits) const {
  std::vector<Opinion> opinions;
  opinions.reserve(refits.size());
  for (const VectorXd& prediction : predictions(refits)) {
    Opinion& opinion = opinions.emplace_back();
    opinion.stacked = study_->measured() - prediction;
    opinion.residual = opinion.stacked.tail(study_->held().size());
    if (!refitter_ && whitening_) {
      const VectorXd white = whitening_->apply(opinion.residual);
      opinion.deviance = white.squaredNorm();
      add_by_block(study_->held(), study_->model().captures(), white, opinion.blocks);
    }
  }
  return opinions;
}

Gain Judge::gain_of(const Opinion& before, const Opinion& after, int numbers,
                    const GainOptions& options) const {
  HeldOut residuals;
  residuals.before = before.residual;
  residuals.after = after.residual;
  residuals.last_residual = keep_last_residual(*study_, before.stacked);
  residuals.free_field = free_field_residual(
      *study_, before.stacked, theta_,
      theta_prior(study_->model(), fit_noise_.corrections).precision,
      [&](const MatrixXd& columns) { return used_whitening_->apply(columns); }, numbers);
  return gain(study_->held(), study_->model().captures(), residuals,
              noise_floor(study_->held(), held_noise_, held_solver_), options);
}

}  // namespace matterfit::diagnose
