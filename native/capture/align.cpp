// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/align.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

/// Spread across the widest line through points, relative to the spread along it, below which a
/// rotation about that line is not determined by them.
constexpr double kLineTolerance = 1e-6;

bool on_a_line(std::span<const Vec3d> points, std::span<const double> weights,
               const Vec3d& centre) {
  Mat3d spread = Mat3d::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (weights[i] == 0.0) continue;
    const Vec3d d = points[i] - centre;
    spread += weights[i] * d * d.transpose();
  }
  const Vec3d values = spread.jacobiSvd().singularValues();
  return !(std::sqrt(values[1]) > kLineTolerance * std::sqrt(values[0]));
}

Vec3d centre_of(std::span<const Vec3d> points, std::span<const double> weights) {
  Vec3d sum = Vec3d::Zero();
  double total = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (weights[i] == 0.0) continue;
    sum += weights[i] * points[i];
    total += weights[i];
  }
  return sum / total;
}

}  // namespace

Eigen::Matrix4d RigidFit::matrix() const {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = rotation;
  m.topRightCorner<3, 1>() = translation;
  return m;
}

RigidFit fit_rigid(std::span<const Vec3d> from, std::span<const Vec3d> to,
                   std::span<const double> weights) {
  if (from.size() != to.size() || (!weights.empty() && weights.size() != from.size())) {
    throw_input("a rigid fit has " + std::to_string(from.size()) + " points, " +
                std::to_string(to.size()) + " places and " + std::to_string(weights.size()) +
                " weights; expected equal numbers.");
  }
  std::vector<double> weight(weights.begin(), weights.end());
  if (weight.empty()) weight.assign(from.size(), 1.0);
  std::size_t used = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (!(weight[i] >= 0.0) || !std::isfinite(weight[i])) {
      throw_input("a rigid fit: weight " + std::to_string(i) + " is negative or not finite.");
    }
    if (weight[i] == 0.0) continue;
    ++used;
    if (!from[i].allFinite() || !to[i].allFinite()) {
      throw_input("a rigid fit: point " + std::to_string(i) +
                  " has no position. Leave it out, or choose frames in which it is visible.");
    }
  }
  if (used < 3) {
    throw_input("a rigid fit needs at least 3 points, " + std::to_string(used) + " take part.");
  }
  const Vec3d from_centre = centre_of(from, weight);
  const Vec3d to_centre = centre_of(to, weight);
  if (on_a_line(from, weight, from_centre) || on_a_line(to, weight, to_centre)) {
    throw_input("a rigid fit needs points that do not all lie on one line.");
  }
  Mat3d covariance = Mat3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (weight[i] == 0.0) continue;
    covariance += weight[i] * (to[i] - to_centre) * (from[i] - from_centre).transpose();
  }
  const Eigen::JacobiSVD<Mat3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // The last axis is turned round where the best orthogonal matrix would mirror.
  Vec3d signs = Vec3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) signs[2] = -1.0;

  RigidFit fit;
  fit.rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  fit.translation = to_centre - fit.rotation * from_centre;
  double sum = 0.0;
  double total = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const double residual = (fit(from[i]) - to[i]).norm() * 1e3;
    fit.residual_mm.push_back(residual);
    if (weight[i] == 0.0) continue;
    sum += weight[i] * residual * residual;
    total += weight[i];
  }
  fit.rms_mm = std::sqrt(sum / total);
  return fit;
}

Points mean_positions(const Tracks& tracks, std::size_t begin, std::size_t end) {
  if (begin >= end || end > tracks.frames()) {
    throw_input("frames " + std::to_string(begin) + " up to, and without, " + std::to_string(end) +
                " do not lie in a capture of " + std::to_string(tracks.frames()) + " frames.");
  }
  Points means(tracks.points);
  for (std::size_t point = 0; point < tracks.points; ++point) {
    Vec3d sum = Vec3d::Zero();
    std::size_t count = 0;
    for (std::size_t frame = begin; frame < end; ++frame) {
      if (!tracks.is_visible(frame, point)) continue;
      sum += tracks.position(frame, point);
      ++count;
    }
    means[point] = count > 0 ? Vec3d(sum / static_cast<double>(count))
                             : Vec3d(Vec3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  }
  return means;
}

RigidFit align_tracks(const Tracks& tracks, std::span<const Vec3d> positions,
                      const AlignOptions& options) {
  std::vector<std::size_t> points = options.points;
  if (points.empty()) {
    for (std::size_t i = 0; i < tracks.points; ++i) points.push_back(i);
  }
  if (points.size() != positions.size()) {
    throw_input("the alignment has " + std::to_string(points.size()) + " markers and " +
                std::to_string(positions.size()) + " places on the model; expected equal numbers.");
  }
  const Points means = mean_positions(tracks, options.begin, options.end);
  Points from;
  std::vector<double> weights;
  for (const std::size_t point : points) {
    if (point >= tracks.points) {
      throw_input("the alignment names marker " + std::to_string(point) + " of " +
                  std::to_string(tracks.points) + ".");
    }
    const bool excluded =
        std::find(options.exclude.begin(), options.exclude.end(), point) != options.exclude.end();
    from.push_back(means[point]);
    weights.push_back(excluded ? 0.0 : 1.0);
  }
  return fit_rigid(from, positions, weights);
}

}  // namespace matterfit::capture
