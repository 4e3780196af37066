// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/whitening.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// U of the shared parts: for each capture and axis a Cholesky factor of the AR(1) over frames,
/// spread to the rows.
MatrixXd common_columns(const Rows& rows, const Noise& noise) {
  std::vector<VectorXd> columns;
  for (std::size_t c = 0; c < noise.captures.size(); ++c) {
    const TrackNoise& track = noise.captures[c];
    if (!(track.common_sigma > 0.0)) continue;
    for (int axis = 0; axis < 3; ++axis) {
      std::map<Index, Index> place;
      std::vector<double> times;
      for (const Series& series : rows.series()) {
        if (series.capture != int(c) || series.axis != axis) continue;
        for (Index i = series.begin; i < series.end; ++i) place[rows.frame(i)] = 0;
      }
      times.resize(place.size());
      Index count = 0;
      for (auto& [frame, index] : place) index = count++;
      for (const Series& series : rows.series()) {
        if (series.capture != int(c) || series.axis != axis) continue;
        for (Index i = series.begin; i < series.end; ++i) {
          times[std::size_t(place[rows.frame(i)])] = rows.time(i);
        }
      }
      MatrixXd covariance(count, count);
      for (Index a = 0; a < count; ++a) {
        for (Index b = 0; b < count; ++b) {
          const double steps =
              std::abs(times[std::size_t(a)] - times[std::size_t(b)]) / track.interval;
          covariance(a, b) = track.common_sigma * track.common_sigma *
                             (a == b ? 1.0 : std::pow(track.common_correlation, steps));
        }
      }
      const MatrixXd factor = covariance.llt().matrixL();
      for (Index k = 0; k < count; ++k) {
        VectorXd column = VectorXd::Zero(rows.size());
        for (const Series& series : rows.series()) {
          if (series.capture != int(c) || series.axis != axis) continue;
          for (Index i = series.begin; i < series.end; ++i) {
            column[i] = factor(place[rows.frame(i)], k);
          }
        }
        columns.push_back(std::move(column));
      }
    }
  }
  MatrixXd result(rows.size(), Index(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) result.col(Index(k)) = columns[k];
  return result;
}

}  // namespace

Whitening::Whitening(const Rows& rows, const Noise& noise, const MatrixXd& spread)
    : rows_(rows), noise_(noise) {
  find_places();
  const MatrixXd common = common_columns(rows, noise);
  factor_.resize(rows.size(), common.cols() + spread.cols());
  if (common.cols() > 0) factor_.leftCols(common.cols()) = common;
  if (spread.cols() > 0) factor_.rightCols(spread.cols()) = spread;
  vectors_.resize(rows.size(), 0);
  if (factor_.cols() == 0) return;
  const MatrixXd v = own(factor_);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(v.transpose() * v);
  // Directions a thousandth of the noise in size change nothing.
  std::vector<Index> kept;
  kept.reserve(std::size_t(v.cols()));
  for (Index k = 0; k < v.cols(); ++k) {
    if (solver.eigenvalues()[k] > 1e-6) kept.push_back(k);
  }
  vectors_.resize(rows.size(), Index(kept.size()));
  shrink_.resize(Index(kept.size()));
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const double square = solver.eigenvalues()[kept[k]];
    vectors_.col(Index(k)) = v * solver.eigenvectors().col(kept[k]) / std::sqrt(square);
    shrink_[Index(k)] = 1.0 - 1.0 / std::sqrt(1.0 + square);
  }
}

void Whitening::find_places() {
  if (noise_.turns.empty()) return;
  for (TrackRows& track : track_rows(rows_, noise_.turns)) {
    const double sigma = noise_.captures[std::size_t(track.capture)].place_sigma;
    if (!(sigma > 0.0)) continue;
    track.shift *= sigma;
    Place place{std::move(track), {}, Eigen::Vector3d::Zero()};
    MatrixXd whole = MatrixXd::Zero(rows_.size(), 3);
    place.track.scatter(place.track.shift, whole);
    for (const auto& [begin, end] : place.track.segments) {
      recursion(place.track.capture, begin, end, whole);
    }
    const MatrixXd e = place.track.gather(whole);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(e.transpose() * e);
    place.vectors = MatrixXd::Zero(e.rows(), 3);
    for (Index k = 0; k < 3; ++k) {
      const double square = solver.eigenvalues()[k];
      if (!(square > 1e-6)) continue;
      place.vectors.col(k) = e * solver.eigenvectors().col(k) / std::sqrt(square);
      place.shrink[k] = 1.0 - 1.0 / std::sqrt(1.0 + square);
    }
    places_.push_back(std::move(place));
  }
}

void Whitening::take_places(MatrixXd& x) const {
  for (const Place& place : places_) {
    MatrixXd values = place.track.gather(x);
    values -= place.vectors * (place.shrink.asDiagonal() * (place.vectors.transpose() * values));
    place.track.scatter(values, x);
  }
}

double Whitening::step_correlation(double correlation, const TrackNoise& noise, Index row) const {
  const double steps = (rows_.time(row) - rows_.time(row - 1)) / noise.interval;
  // A negative correlation has no meaning between frames: it holds for one frame's step only.
  if (correlation < 0.0) return std::abs(steps - 1.0) < 0.5 ? correlation : 0.0;
  return std::pow(correlation, steps);
}

void Whitening::recursion(int capture, Index begin, Index end, MatrixXd& x) const {
  const TrackNoise& noise = noise_.captures[std::size_t(capture)];
  for (Index i = end - 1; i > begin; --i) {
    const double phi = step_correlation(noise.correlation, noise, i);
    const double scale = noise_.weights[i] / (noise.sigma * std::sqrt(1.0 - phi * phi));
    x.row(i) = scale * (x.row(i) - phi * x.row(i - 1));
  }
  x.row(begin) *= noise_.weights[begin] / noise.sigma;
}

MatrixXd Whitening::own(MatrixXd x) const {
  for (const Series& series : rows_.series()) {
    recursion(series.capture, series.begin, series.end, x);
  }
  take_places(x);
  return x;
}

MatrixXd Whitening::own_transposed(MatrixXd x) const {
  take_places(x);
  for (const Series& series : rows_.series()) {
    const TrackNoise& noise = noise_.captures[std::size_t(series.capture)];
    x.row(series.begin) *= noise_.weights[series.begin] / noise.sigma;
    for (Index i = series.begin + 1; i < series.end; ++i) {
      const double phi = step_correlation(noise.correlation, noise, i);
      x.row(i) *= noise_.weights[i] / (noise.sigma * std::sqrt(1.0 - phi * phi));
      x.row(i - 1) -= phi * x.row(i);
    }
  }
  return x;
}

MatrixXd Whitening::low_rank(const MatrixXd& x) const {
  if (vectors_.cols() == 0) return x;
  return x - vectors_ * (shrink_.asDiagonal() * (vectors_.transpose() * x));
}

MatrixXd Whitening::apply(const MatrixXd& columns) const { return low_rank(own(columns)); }

MatrixXd Whitening::covariance_if(const MatrixXd& white, std::size_t n) const {
  MatrixXd x = own_transposed(low_rank(white));
  const MatrixXd low = factor_.transpose() * x;
  MatrixXd sum = low.transpose() * low;
  for (const Place& place : places_) {
    const MatrixXd moved = place.track.shift.transpose() * place.track.gather(x);
    sum += moved.transpose() * moved;
  }
  // Lᵀ x of the other AR(1), L its Cholesky factor, from the last row backwards.
  for (const Series& series : rows_.series()) {
    const TrackNoise& noise = noise_.captures[std::size_t(series.capture)];
    for (Index i = series.end - 1; i > series.begin; --i) {
      const double phi = step_correlation(noise.plausible[n], noise, i);
      x.row(i - 1) += phi * x.row(i);
      x.row(i) *= noise.sigma * std::sqrt(1.0 - phi * phi);
    }
    x.row(series.begin) *= noise.sigma;
  }
  return x.transpose() * x + sum;
}

}  // namespace matterfit::diagnose
