// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/analysis.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "diagnose/chi_square.hpp"
#include "diagnose/priors.hpp"
#include "diagnose/refit.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Cosines over time of the smooth unknowns that noise is kept clear of: a discrepancy in a clip of
/// 30 frames is slower than one swing in ten of them.
constexpr int kNoiseCosines = 6;
/// Numbers of correlations that Noise keeps (TrackNoise::plausible).
constexpr std::size_t kPlausible = 5;

std::vector<Tested> tested_of(const Model& model, const Linearised& slopes) {
  std::vector<Tested> tested;
  Index first = 0;
  for (const Linearised::Column& column : slopes.columns) {
    if (column.values.cols() == 0) continue;
    const Effect& effect = model.effects()[std::size_t(column.candidate.effect)];
    Tested t{column.candidate,
             first,
             column.values.cols(),
             VectorXd(column.values.cols()),
             VectorXd(column.values.cols()),
             {}};
    for (Index k = 0; k < t.count; ++k) {
      const Number& number = effect.numbers[std::size_t(k)];
      t.low[k] = number.one_sided ? 0.0 : (number.low - number.neutral) / number.scale;
      t.high[k] = (number.high - number.neutral) / number.scale;
      const double precision = precision_of(number);
      if (!(precision > 0.0)) continue;
      if (t.precision.size() == 0) t.precision = VectorXd::Zero(t.count);
      t.precision[k] = precision;
    }
    first += t.count;
    tested.push_back(std::move(t));
  }
  return tested;
}

MatrixXd candidate_columns(const Linearised& slopes, Index rows) {
  Index count = 0;
  for (const auto& column : slopes.columns) count += column.values.cols();
  MatrixXd result(rows, count);
  Index at = 0;
  for (const auto& column : slopes.columns) {
    result.middleCols(at, column.values.cols()) = column.values.topRows(rows);
    at += column.values.cols();
  }
  return result;
}

MatrixXd side_by_side(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd result(a.rows(), a.cols() + b.cols());
  result << a, b;
  return result;
}

/// The shape of each candidate effect whose columns take most of the residual away, beside `known`
/// ones.
std::vector<const Linearised::Column*> nearest_shapes(const Linearised& slopes,
                                                      const MatrixXd& known,
                                                      const VectorXd& residual) {
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> solver;
  if (known.cols() > 0) solver.compute(known);
  const auto beside_known = [&](const MatrixXd& columns) -> MatrixXd {
    if (known.cols() == 0) return columns;
    return columns - known * solver.solve(columns);
  };
  const VectorXd left = beside_known(residual);
  struct Nearest {
    const Linearised::Column* shape;
    double taken;
  };
  std::map<int, Nearest> of_effect;
  for (const Linearised::Column& shape : slopes.columns) {
    if (shape.values.cols() == 0) continue;
    const MatrixXd own = shape.values.topRows(residual.size());
    const MatrixXd free = beside_known(own);
    const double taken = (free * free.completeOrthogonalDecomposition().solve(left)).norm();
    const auto [at, first] = of_effect.try_emplace(shape.candidate.effect, Nearest{&shape, taken});
    if (!first && taken > at->second.taken) at->second = {&shape, taken};
  }
  std::vector<const Linearised::Column*> result;
  result.reserve(of_effect.size());
  for (const auto& [effect, nearest] : of_effect) result.push_back(nearest.shape);
  return result;
}

std::vector<MatrixXd> covariances(const Whitening& whitening, const MatrixXd& white) {
  std::vector<MatrixXd> result;
  result.reserve(kPlausible);
  for (std::size_t n = 0; n < kPlausible; ++n) {
    result.push_back(whitening.covariance_if(white, n));
  }
  return result;
}

double smallest_freedom(const Noise& noise) {
  double least = 1e300;
  for (const TrackNoise& track : noise.captures) least = std::min(least, track.freedom);
  return least;
}

}  // namespace

MatrixXd explained_columns(const Study& study, const Linearised& slopes, const Spread& spread,
                           const VectorXd& residual) {
  const Index used = study.used().size();
  MatrixXd columns = side_by_side(slopes.theta.topRows(used), slopes.active.topRows(used));
  for (const Linearised::Column* shape : nearest_shapes(slopes, columns, residual)) {
    columns = side_by_side(columns, shape->values.topRows(used));
  }
  columns =
      side_by_side(columns, smooth_basis(study.used(), study.model().captures(), kNoiseCosines));
  columns = side_by_side(columns, spread.members.topRows(used));
  columns = side_by_side(columns, spread.directions.topRows(used));
  for (Index k = 0; k < columns.cols(); ++k) {
    const double norm = columns.col(k).norm();
    if (norm > 0.0) columns.col(k) /= norm;
  }
  return columns;
}

Analysis analyse(const Study& study, const State& state, const Linearised& slopes,
                 const Spread& spread, const Noise& noise, const VectorXd& prediction, double bias,
                 const AnalysisOptions& options) {
  const Model& model = study.model();
  const Index used = study.used().size();
  const bool biased = spread.bias.size() == study.size();
  const Index p = state.theta.size();
  MatrixXd nuisances = side_by_side(slopes.theta.topRows(used), slopes.active.topRows(used));
  if (biased) nuisances = side_by_side(nuisances, -spread.bias.head(used));
  Index n = nuisances.cols();
  VectorXd precision = VectorXd::Zero(n);
  VectorXd pull = VectorXd::Zero(n);
  const ThetaPrior prior = theta_prior(model, noise.corrections);
  precision.head(p) = prior.precision;
  for (Index i = 0; i < p; ++i) {
    pull[i] = prior.precision[i] * (state.theta[i] - prior.mean[i]) /
              model.parameters()[std::size_t(i)].scale;
  }
  if (biased) {
    precision[n - 1] = 1.0 / (kBiasSigma * kBiasSigma);
    pull[n - 1] = precision[n - 1] * (bias - kBiasMean);
  }
  // A number that moves nothing here, or could not be moved, takes nothing away: of its column only
  // rounding would be left.
  std::vector<Index> moving;
  for (Index k = 0; k < n; ++k) {
    if (nuisances.col(k).squaredNorm() > 0.0) moving.push_back(k);
  }
  n = Index(moving.size());
  nuisances = MatrixXd(nuisances(Eigen::all, moving));
  precision = VectorXd(precision(moving));
  pull = VectorXd(pull(moving));

  const Index members = spread.members.cols();
  const MatrixXd own = spread.members.topRows(used);
  const SolverColumns solver = solver_columns(study.used(), model.captures(), spread.top(used));
  const Whitening whitening(study.used(), noise, solver.values);
  const MatrixXd raw = side_by_side(nuisances, candidate_columns(slopes, used));
  const MatrixXd white = whitening.apply(raw);
  const VectorXd residual = whitening.apply((study.measured() - prediction).head(used));
  const std::vector<Tested> tested = tested_of(model, slopes);
  const double freedom = smallest_freedom(noise);

  Analysis result{ScoreTest(white.transpose() * white, precision, tested), {}, {}, {}, {}, {}, {}};
  result.residual = residual;
  result.numerators = result.test.numerators(white.transpose() * residual, pull);
  result.scores = result.test.scores(result.numerators);
  draw_noise(result.test, covariances(whitening, white), freedom, options.placebo, result.placebo);
  if (members > 0) {
    const Whitening measurement(study.used(), noise, MatrixXd(used, 0));
    const MatrixXd all = measurement.apply(side_by_side(raw, side_by_side(solver.values, own)));
    draw_members(all.transpose() * all, solver.member, precision, tested, options.placebo,
                 result.placebo);
  }
  set_threshold(options.placebo, result.placebo);
  MatrixXd h = white.leftCols(n).transpose() * white.leftCols(n);
  h.diagonal() += precision;
  h.diagonal() *= 1.0 + 1e-10;
  h.diagonal().array() += 1e-300;
  const MatrixXd candidates = white.rightCols(white.cols() - n);
  result.signatures =
      candidates - white.leftCols(n) * h.ldlt().solve(white.leftCols(n).transpose() * candidates);

  // The smooth part as one group of many numbers.
  const MatrixXd smooth =
      whitening.apply(smooth_basis(study.used(), model.captures(), options.cosines));
  const MatrixXd both = side_by_side(white.leftCols(n), smooth);
  std::vector<Tested> group(1);
  group[0].count = smooth.cols();
  group[0].low = VectorXd::Constant(smooth.cols(), -1e300);
  group[0].high = VectorXd::Constant(smooth.cols(), 1e300);
  const ScoreTest smooth_test(both.transpose() * both, precision, group);
  const Score score =
      smooth_test.scores(smooth_test.numerators(both.transpose() * residual, pull))[0];
  Placebo smooth_placebo;
  PlaceboOptions again = options.placebo;
  again.seed += 17;
  again.draws = std::max(200, options.placebo.draws / 2);
  draw_noise(smooth_test, covariances(whitening, both), freedom, again, smooth_placebo);
  if (members > 0) {
    const Whitening measurement(study.used(), noise, MatrixXd(used, 0));
    MatrixXd all =
        side_by_side(nuisances, smooth_basis(study.used(), model.captures(), options.cosines));
    all = measurement.apply(side_by_side(all, side_by_side(solver.values, own)));
    draw_members(all.transpose() * all, solver.member, precision, group, again, smooth_placebo);
  }
  result.smooth = {score.statistic, score.freedom, smooth_placebo.p(score.equivalent)};
  return result;
}

std::vector<double> evidence_by_frame(const Study& study, const Analysis& analysis, std::size_t k,
                                      const VectorXd& estimate) {
  const Tested& tested = analysis.test.tested()[k];
  const VectorXd signature = analysis.signatures.middleCols(tested.first, tested.count) * estimate;
  std::vector<double> result;
  for (std::size_t c = 0; c < study.model().captures().size(); ++c) {
    const std::size_t frames = study.model().captures()[c].times.size();
    std::vector<double> s(frames, 0.0);
    std::vector<double> i(frames, 0.0);
    for (const Series& series : study.used().series()) {
      if (series.capture != int(c)) continue;
      for (Index row = series.begin; row < series.end; ++row) {
        const std::size_t f = std::size_t(study.used().frame(row));
        s[f] += signature[row] * analysis.residual[row];
        i[f] += signature[row] * signature[row];
      }
    }
    // An eighth of the clip: long enough to gather evidence, short enough to say when.
    const std::size_t half = std::max<std::size_t>(1, frames / 16);
    for (std::size_t f = 0; f < frames; ++f) {
      double score = 0.0;
      double information = 0.0;
      for (std::size_t g = f > half ? f - half : 0; g < std::min(frames, f + half + 1); ++g) {
        score += s[g];
        information += i[g];
      }
      result.push_back(information > 0.0 ? score * score / information : 0.0);
    }
  }
  return result;
}

}  // namespace matterfit::diagnose
