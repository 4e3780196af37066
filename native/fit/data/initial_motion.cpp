// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/initial_motion.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "capture/align.hpp"
#include "math/rotation_vector.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Spread across the widest line through points, relative to that along it, below which they lie on
/// it; and relative to what the motion leaves over.
constexpr double kOnALine = 1e-3;
constexpr double kInTheNoise = 3.0;
/// Eigenvalue of the normal equations, without units, that counts as 0.
constexpr double kUndetermined = 1e-13;

enum class CloudShape : std::uint8_t { kPoint, kLine, kSolid };

Mat3d cross(const Vec3d& v) {
  Mat3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

/// exp(v + d) = exp(left_jacobian(v) d) exp(v) for small d.
Mat3d left_jacobian(const Vec3d& v) {
  const double angle = v.norm();
  const Mat3d k = cross(v);
  if (angle < 1e-4) return Mat3d::Identity() + 0.5 * k + k * k / 6.0;
  const double square = angle * angle;
  return Mat3d::Identity() + (1.0 - std::cos(angle)) / square * k +
         (angle - std::sin(angle)) / (square * angle) * k * k;
}

/// The rotation vector of length at most π.
Vec3d logarithm(const Mat3d& rotation) {
  Quatd q(rotation);
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  const double half_sine = q.vec().norm();
  if (half_sine == 0.0) return Vec3d::Zero();
  return 2.0 * std::atan2(half_sine, q.w()) / half_sine * q.vec();
}

struct Spread {
  double along = 0.0;   ///< root mean square along the widest line
  double across = 0.0;  ///< along the widest line across it
  Vec3d line = Vec3d::UnitX();
};

Spread spread_of(const Points& points) {
  if (points.empty()) return {};
  Vec3d mean = Vec3d::Zero();
  for (const Vec3d& x : points) mean += x / double(points.size());
  Mat3d sum = Mat3d::Zero();
  for (const Vec3d& x : points) {
    sum += (x - mean) * (x - mean).transpose() / double(points.size());
  }
  const Eigen::SelfAdjointEigenSolver<Mat3d> eigen(sum);
  const Vec3d values = eigen.eigenvalues().cwiseMax(0.0);
  return {std::sqrt(values[2]), std::sqrt(values[1]), eigen.eigenvectors().col(2)};
}

/// The shape of points whose distance from the centre is about 1.
CloudShape shape_of(const Spread& spread) {
  if (!(spread.along > 1e-9)) return CloudShape::kPoint;
  return spread.across > kOnALine * spread.along ? CloudShape::kSolid : CloudShape::kLine;
}

struct Sample {
  std::size_t frame = 0;
  Vec3d arm;       ///< rest position against the centre
  Vec3d position;  ///< captured, against the centre at rest, less ½ g t²
};

struct Record {
  std::vector<double> times;  ///< against the middle of the record, in units of `duration`
  std::vector<Sample> samples;
  double middle = 0.0;    ///< [s]
  double duration = 1.0;  ///< [s]
  double extent = 1.0;    ///< [m], the unit of all places
};

/// A motion about the middle of the record, in its units.
struct Motion {
  Vec3d place = Vec3d::Zero();
  Vec3d velocity = Vec3d::Zero();
  Vec3d spin = Vec3d::Zero();
  Mat3d rotation = Mat3d::Identity();

  [[nodiscard]] std::vector<Mat3d> turned(const Record& record) const {
    std::vector<Mat3d> result;
    for (const double t : record.times) result.push_back(rotation_by(t * spin));
    return result;
  }
  [[nodiscard]] Vec3d error(const Record& record, const Sample& sample, const Mat3d& turn) const {
    return place + record.times[sample.frame] * velocity + turn * (rotation * sample.arm) -
           sample.position;
  }
  [[nodiscard]] double square(const Record& record) const {
    const std::vector<Mat3d> turn = turned(record);
    double sum = 0.0;
    for (const Sample& sample : record.samples) {
      sum += error(record, sample, turn[sample.frame]).squaredNorm();
    }
    return sum;
  }
};

/// One frame's rotation against rest; for points on a line the shortest that carries it over, from
/// the frame before.
struct Placed {
  double time = 0.0;
  Mat3d rotation;
};

std::vector<Placed> place_frames(const Record& record, CloudShape shape, const Vec3d& line) {
  std::vector<Placed> placed;
  Vec3d before = line;
  Mat3d rotation = Mat3d::Identity();
  std::size_t i = 0;
  for (std::size_t frame = 0; frame < record.times.size(); ++frame) {
    Points from;
    Points to;
    for (; i < record.samples.size() && record.samples[i].frame == frame; ++i) {
      from.push_back(record.samples[i].arm);
      to.push_back(record.samples[i].position);
    }
    if (shape == CloudShape::kSolid) {
      const bool determined = from.size() >= 3 && shape_of(spread_of(from)) == CloudShape::kSolid &&
                              shape_of(spread_of(to)) == CloudShape::kSolid;
      if (determined)
        placed.push_back({record.times[frame], capture::fit_rigid(from, to).rotation});
      continue;
    }
    Vec3d from_mean = Vec3d::Zero();
    for (const Vec3d& x : from) from_mean += x / double(from.size());
    Vec3d direction = Vec3d::Zero();
    for (std::size_t k = 0; k < from.size(); ++k) {
      direction += line.dot(from[k] - from_mean) * to[k];
    }
    if (!(direction.norm() > 1e-9)) continue;
    direction.normalize();
    rotation = Quatd::FromTwoVectors(before, direction).toRotationMatrix() * rotation;
    before = direction;
    placed.push_back({record.times[frame], rotation});
  }
  return placed;
}

/// Spin from the turns between frames, rotation from the frame in the middle.
void set_rotation(const std::vector<Placed>& placed, Motion& motion) {
  if (placed.empty()) return;
  Vec3d sum = Vec3d::Zero();
  for (std::size_t i = 1; i < placed.size(); ++i) {
    sum += logarithm(placed[i].rotation * placed[i - 1].rotation.transpose());
  }
  if (placed.size() > 1) motion.spin = sum / (placed.back().time - placed.front().time);
  const Placed& middle = placed[placed.size() / 2];
  motion.rotation = rotation_by(-middle.time * motion.spin) * middle.rotation;
}

/// Directions in which a rotation vector may change: all, or across the line as it lies at the
/// middle of the record.
MatrixXd turns(const Motion& motion, CloudShape shape, const Vec3d& line) {
  if (shape == CloudShape::kPoint) return MatrixXd(3, 0);
  if (shape == CloudShape::kSolid) return Mat3d::Identity();
  const Vec3d along = motion.rotation * line;
  MatrixXd across(3, 2);
  const Vec3d first = along.unitOrthogonal();
  across << first, along.cross(first);
  return across;
}

/// The Gauss–Newton step, least in norm where the samples do not determine it: place, velocity,
/// rotation, spin.
Eigen::Matrix<double, 12, 1> newton(const Record& record, const Motion& motion,
                                    const MatrixXd& free) {
  const Index n = 6 + 2 * free.cols();
  MatrixXd normal = MatrixXd::Zero(n, n);
  VectorXd gradient = VectorXd::Zero(n);
  MatrixXd row(3, n);
  row.leftCols<3>().setIdentity();
  std::vector<Mat3d> spinning;
  for (const double t : record.times) spinning.push_back(t * left_jacobian(t * motion.spin));
  const std::vector<Mat3d> turn = motion.turned(record);
  for (const Sample& sample : record.samples) {
    const double t = record.times[sample.frame];
    const Mat3d& turned = turn[sample.frame];
    const Vec3d arm = motion.rotation * sample.arm;
    row.middleCols<3>(3) = t * Mat3d::Identity();
    row.middleCols(6, free.cols()) = -turned * cross(arm) * free;
    row.rightCols(free.cols()) = -cross(turned * arm) * spinning[sample.frame] * free;
    normal += row.transpose() * row;
    gradient += row.transpose() * motion.error(record, sample, turned);
  }
  const VectorXd root = normal.diagonal().cwiseMax(1e-300).cwiseSqrt();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(root.cwiseInverse().asDiagonal() * normal *
                                                      root.cwiseInverse().asDiagonal());
  VectorXd along = eigen.eigenvectors().transpose() * gradient.cwiseQuotient(root);
  for (Index k = 0; k < n; ++k) {
    const double value = eigen.eigenvalues()[k];
    along[k] = value > kUndetermined ? -along[k] / value : 0.0;
  }
  const VectorXd solution = (eigen.eigenvectors() * along).cwiseQuotient(root);
  Eigen::Matrix<double, 12, 1> step;
  step << solution.head<6>(), free * solution.segment(6, free.cols()),
      free * solution.tail(free.cols());
  return step;
}

Motion fitted(const Record& record, CloudShape shape, const Vec3d& line) {
  Motion motion;
  if (shape != CloudShape::kPoint) set_rotation(place_frames(record, shape, line), motion);
  double square = motion.square(record);
  for (int iteration = 0; iteration < 50; ++iteration) {
    const auto step = newton(record, motion, turns(motion, shape, line));
    bool better = false;
    for (double length = 1.0; length > 1e-3 && !better; length *= 0.5) {
      Motion trial = motion;
      trial.place += length * step.segment<3>(0);
      trial.velocity += length * step.segment<3>(3);
      trial.rotation = rotation_by(length * step.segment<3>(6)) * motion.rotation;
      trial.spin += length * step.segment<3>(9);
      if (shape == CloudShape::kLine) {
        const Vec3d along = trial.rotation * line;
        trial.spin -= along * along.dot(trial.spin);
      }
      const double left = trial.square(record);
      better = left < square;
      if (!better) continue;
      motion = trial;
      square = left;
    }
    if (!better || !(step.norm() > 1e-14)) break;
  }
  return motion;
}

Record record_of(std::span<const Vec3d> rest, const Vec3d& center, std::span<const double> times,
                 std::span<const Vec3d> positions, const Vec3d& gravity) {
  if (times.size() < 2) {
    throw_input("the initial motion needs at least 2 frames before contact, there are " +
                std::to_string(times.size()) + ".");
  }
  if (positions.size() != times.size() * rest.size()) {
    throw_input("the initial motion has " + std::to_string(positions.size()) + " positions for " +
                std::to_string(times.size()) + " frames of " + std::to_string(rest.size()) +
                " points.");
  }
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (!std::isfinite(times[i]) || (i > 0 && !(times[i] > times[i - 1]))) {
      throw_input("the initial motion: the times must be finite and ascending; frame " +
                  std::to_string(i) + " is not.");
    }
  }
  Record record;
  std::vector<std::size_t> seen(rest.size(), 0);
  double square = 0.0;
  record.duration = 0.5 * (times.back() - times.front());
  record.middle = times.front() + record.duration;
  for (std::size_t frame = 0; frame < times.size(); ++frame) {
    const double t = times[frame] - record.middle;
    record.times.push_back(t / record.duration);
    for (std::size_t point = 0; point < rest.size(); ++point) {
      const Vec3d& x = positions[frame * rest.size() + point];
      if (!x.allFinite() || !rest[point].allFinite()) continue;
      ++seen[point];
      const Vec3d arm = rest[point] - center;
      square += arm.squaredNorm();
      record.samples.push_back({frame, arm, x - center - 0.5 * t * t * gravity});
    }
  }
  if (std::none_of(seen.begin(), seen.end(), [](std::size_t count) { return count >= 2; })) {
    throw_input(
        "the initial motion needs a point that is seen in at least 2 frames before contact.");
  }
  if (square > 0.0) record.extent = std::sqrt(square / double(record.samples.size()));
  for (Sample& sample : record.samples) {
    sample.arm /= record.extent;
    sample.position /= record.extent;
  }
  return record;
}

}  // namespace

InitialMotion initial_motion(std::span<const Vec3d> rest, const Vec3d& center,
                             std::span<const double> times, std::span<const Vec3d> positions,
                             const Vec3d& gravity) {
  const Record record = record_of(rest, center, times, positions, gravity);
  Points arms;
  for (const Sample& sample : record.samples) arms.push_back(sample.arm);
  const Spread spread = spread_of(arms);
  const auto count = double(record.samples.size());

  CloudShape shape = shape_of(spread);
  Motion motion = fitted(record, shape, spread.line);
  if (shape == CloudShape::kSolid) {
    const double noise = std::sqrt(motion.square(record) / count);
    if (spread.across < kInTheNoise * noise) shape = CloudShape::kLine;
    if (spread.along < kInTheNoise * noise) shape = CloudShape::kPoint;
    if (shape != CloudShape::kSolid) motion = fitted(record, shape, spread.line);
  }

  // From the middle of the record to time 0.
  const double back = record.middle;
  const Vec3d velocity = motion.velocity * record.extent / record.duration;
  InitialMotion result;
  result.spin = motion.spin / record.duration;
  result.velocity = velocity - back * gravity;
  result.offset = motion.place * record.extent - back * velocity + 0.5 * back * back * gravity;
  result.rotation = logarithm(rotation_by(-back * result.spin) * motion.rotation);
  result.residual = record.extent * std::sqrt(motion.square(record) / count);
  result.spin_observable = shape == CloudShape::kSolid;
  return result;
}

}  // namespace matterfit::fit
