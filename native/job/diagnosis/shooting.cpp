// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/shooting.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "job/diagnosis/seen_tracks.hpp"
#include "math/rotation_vector.hpp"

namespace matterfit::job {
namespace {

using diagnose::Observation;
using diagnose::Observed;
using Eigen::Index;

constexpr Index kFewestFrames = 4;
constexpr Index kMostFrames = 10;
/// How many times what white noise of the tracks makes of them a state's errors are: a tracker's
/// errors last for frames, and bodies ring.
constexpr double kCorrelated = 2.0;
/// The smallest noise of a coordinate that tracks are thought to have [m].
constexpr double kLeastNoise = 1e-6;

Vec3d log_of(const Mat3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

/// A measured sample as the world had it.
struct Undone {
  const diagnose::Capture& capture;
  std::span<const Observed> observations;

  [[nodiscard]] double time(double t) const {
    double shift = 0.0;
    for (const Observed& o : observations) {
      shift += diagnose::time_shift(o, t, capture.times.front(), o.effect->pivot);
    }
    return t + shift;
  }

  [[nodiscard]] Vec3d place(Index f, Index i) const {
    Vec3d x = SeenTracks{capture}.at(f, i);
    const double since = capture.times[std::size_t(f)] - capture.times.front();
    for (std::size_t k = observations.size(); k-- > 0;) {
      const Observed& o = observations[k];
      switch (o.effect->observation) {
        case Observation::kLag:
          x += o.values[0] * speed(f, i);
          break;
        case Observation::kRollingShutter:
          x -= diagnose::time_shift(o, since, 0.0, x) * speed(f, i);
          break;
        default:
          x = diagnose::undone(o, since, x);
      }
    }
    return x;
  }

 private:
  [[nodiscard]] Vec3d speed(Index f, Index i) const {
    const SeenTracks samples{capture};
    const Index frames = Index(capture.times.size());
    const Index a = f > 0 && samples.seen(f - 1, i) ? f - 1 : f;
    const Index b = f + 1 < frames && samples.seen(f + 1, i) ? f + 1 : f;
    if (a == b) return Vec3d::Zero();
    return (samples.at(b, i) - samples.at(a, i)) /
           (capture.times[std::size_t(b)] - capture.times[std::size_t(a)]);
  }
};

/// Turn of a free body after `span` [s]: its angular momentum stays. Midpoint rule.
Mat3d turned(const Mat3d& rotation, const Vec3d& momentum, const Mat3d& inverse, double span) {
  constexpr double kAngle = 0.02;  // of a step [rad]
  const auto spin = [&](const Mat3d& r) -> Vec3d { return r * inverse * r.transpose() * momentum; };
  const double angle = spin(rotation).norm() * std::abs(span);
  const int steps = std::clamp(int(std::ceil(angle / kAngle)), 1, 1000);
  const double h = span / steps;
  Mat3d r = rotation;
  for (int s = 0; s < steps; ++s) {
    const Mat3d middle = rotation_by(0.5 * h * spin(r)) * r;
    r = rotation_by(h * spin(middle)) * r;
  }
  return r;
}

struct Turning {
  Mat3d rotation;
  Vec3d momentum;
  /// Covariance of rotation and momentum where each turn that was seen errs by a radian.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// The turn and momentum at `time` of a free body that comes nearest to these turns.
Turning free_turning(const std::vector<Mat3d>& seen, const std::vector<double>& times, double time,
                     const Mat3d& moment) {
  constexpr int kIterations = 6;
  const Mat3d inverse = moment.inverse();
  const std::size_t n = seen.size();
  const Vec3d rate = log_of(seen[n - 1] * seen[n - 2].transpose()) / (times[n - 1] - times[n - 2]);
  Turning at{rotation_by((time - times[n - 1]) * rate) * seen[n - 1], Vec3d::Zero()};
  at.momentum = at.rotation * moment * at.rotation.transpose() * rate;
  const double unit = moment.trace();  // a momentum of one radian a second, about
  const auto residuals = [&](const Turning& where) {
    Eigen::VectorXd r(Index(3 * n));
    for (std::size_t f = 0; f < n; ++f) {
      const Mat3d there = turned(where.rotation, where.momentum, inverse, times[f] - time);
      r.segment<3>(Index(3 * f)) = log_of(there * seen[f].transpose());
    }
    return r;
  };
  const auto moved = [&](const Turning& where, const Eigen::VectorXd& by) {
    return Turning{rotation_by(by.head<3>()) * where.rotation,
                   where.momentum + unit * by.tail<3>()};
  };
  Eigen::Matrix<double, 6, 6> information;
  for (int k = 0; k < kIterations; ++k) {
    constexpr double kStep = 1e-5;
    const Eigen::VectorXd r = residuals(at);
    Eigen::MatrixXd slopes(r.size(), 6);
    for (Index c = 0; c < 6; ++c) {
      const Eigen::VectorXd by = kStep * Eigen::VectorXd::Unit(6, c);
      slopes.col(c) = (residuals(moved(at, by)) - residuals(moved(at, -by))) / (2.0 * kStep);
    }
    const Eigen::VectorXd step = slopes.colPivHouseholderQr().solve(-r);
    information = slopes.transpose() * slopes;
    at = moved(at, step);
    if (step.norm() < 1e-9) break;
  }
  Eigen::Matrix<double, 6, 1> units;
  units << 1.0, 1.0, 1.0, unit, unit, unit;
  at.covariance = units.asDiagonal() * information.inverse() * units.asDiagonal();
  return at;
}

}  // namespace

std::vector<ShootingNode> shooting_nodes(const std::vector<Impact>& impacts,
                                         const mpm::Scene& scene) {
  std::vector<ShootingNode> result;
  for (std::size_t k = 1; k < impacts.size(); ++k) {
    const Impact& before = impacts[k - 1];
    const Impact& next = impacts[k];
    if (before.body != next.body || before.capture != next.capture) continue;
    ShootingNode node;
    node.run = next.run;
    node.body = next.body;
    node.capture = next.capture;
    node.last = next.begin - 1;
    node.first = std::max(before.end, node.last + 1 - kMostFrames);
    if (node.last + 1 - node.first < kFewestFrames) continue;
    const double time = next.capture->times[std::size_t(node.last)];
    node.frame = scene.first_frame + int(std::floor(time * scene.fps + 1e-6));
    if (node.frame >= before.frame) result.push_back(node);
  }
  return result;
}

std::optional<ShootingNode> first_flight(const Impact& first) {
  const SeenTracks samples{*first.capture};
  ShootingNode node;
  node.run = first.run;
  node.body = first.body;
  node.capture = first.capture;
  // The frame that points are tied in is no sample.
  const auto shows = [&](Index f) {
    for (Index i = 0; i < first.capture->tracks(); ++i) {
      if (samples.seen(f, i)) return true;
    }
    return false;
  };
  while (node.first < first.begin && !shows(node.first)) ++node.first;
  node.last = first.begin - 1;
  if (node.last + 1 - node.first < kFewestFrames) return std::nullopt;
  return node;
}

Inertia inertia_of(std::span<const Vec3d> places, std::span<const double> volumes) {
  Inertia result;
  double volume = 0.0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    result.center += volumes[i] * places[i];
    volume += volumes[i];
  }
  result.center /= volume;
  result.moment.setZero();
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Vec3d arm = places[i] - result.center;
    result.moment += volumes[i] * (arm.squaredNorm() * Mat3d::Identity() - arm * arm.transpose());
  }
  return result;
}

RigidState with_errors(RigidState state, const std::array<double, kNumbersOfState>& errors) {
  const Eigen::Map<const Vec3d> place(errors.data());
  const Eigen::Map<const Vec3d> turn(errors.data() + 3);
  const Eigen::Map<const Vec3d> velocity(errors.data() + 6);
  const Eigen::Map<const Vec3d> spin(errors.data() + 9);
  state.place += place;
  state.rotation = rotation_by(turn) * state.rotation;
  state.velocity += velocity;
  state.spin += spin;
  return state;
}

std::optional<RigidState> flight_state(const ShootingNode& node, const Inertia& inertia,
                                       double time, std::span<const Observed> observations) {
  const diagnose::Capture& capture = *node.capture;
  if (!(capture.axes[0] && capture.axes[1] && capture.axes[2])) return std::nullopt;
  const SeenTracks samples{capture};
  RigidState state;
  Points rest;
  for (Index i = 0; i < capture.tracks(); ++i) {
    bool all = true;
    for (Index f = node.first; f <= node.last; ++f) all = all && samples.seen(f, i);
    if (!all) continue;
    state.tracks.push_back(std::size_t(i));
    rest.push_back(capture.rest[std::size_t(i)]);
  }
  if (rest.size() < kFewestTracks) return std::nullopt;
  const Undone undone{capture, observations};
  std::vector<Mat3d> turns;
  std::vector<double> times;
  Points centers;
  for (Index f = node.first; f <= node.last; ++f) {
    Points there;
    there.reserve(rest.size());
    for (const std::size_t i : state.tracks) there.push_back(undone.place(f, Index(i)));
    const std::optional<capture::RigidFit> fit = placement_of(rest, there);
    if (!fit) return std::nullopt;
    turns.push_back(fit->rotation);
    centers.push_back((*fit)(inertia.center));
    times.push_back(undone.time(capture.times[std::size_t(f)]));
  }
  const Index n = Index(times.size());
  Eigen::MatrixXd powers(n, 3);
  Eigen::MatrixXd places(n, 3);
  for (Index f = 0; f < n; ++f) {
    const double t = times[std::size_t(f)] - time;
    powers.row(f) << 1.0, t, t * t;
    places.row(f) = centers[std::size_t(f)].transpose();
  }
  const Eigen::MatrixXd parabola = powers.colPivHouseholderQr().solve(places);
  state.place = parabola.row(0).transpose();
  state.velocity = parabola.row(1).transpose();
  const Turning turning = free_turning(turns, times, time, inertia.moment);
  state.rotation = turning.rotation;
  const Mat3d inverse = state.rotation * inertia.moment.inverse() * state.rotation.transpose();
  state.spin = inverse * turning.momentum;
  double arms = 0.0;
  for (const Vec3d& x : rest) arms += (x - inertia.center).squaredNorm();
  const double sigma = kCorrelated * std::max(capture.noise, kLeastNoise);
  const double of_center = sigma / std::sqrt(double(rest.size()));
  const double of_turn = sigma / std::sqrt(2.0 / 3.0 * arms);
  const Eigen::Matrix3d of_parabola = (powers.transpose() * powers).inverse();
  state.noise.place = of_center * std::sqrt(of_parabola(0, 0));
  state.noise.velocity = of_center * std::sqrt(of_parabola(1, 1));
  const Mat3d turns_errors = turning.covariance.topLeftCorner<3, 3>();
  const Mat3d momentum_errors = turning.covariance.bottomRightCorner<3, 3>();
  state.noise.turn = of_turn * std::sqrt(turns_errors.trace() / 3.0);
  state.noise.spin =
      of_turn * std::sqrt((inverse * momentum_errors * inverse.transpose()).trace() / 3.0);
  return state;
}

mpm::RigidChange change_to(const RigidState& state, const ShootingNode& node,
                           const Inertia& inertia, const Points& seen,
                           std::span<const double> volumes, const mpm::ObservedFrame::Body& frame) {
  Points rest;
  Points there;
  for (const std::size_t i : state.tracks) {
    rest.push_back(node.capture->rest[i]);
    there.push_back(seen[i]);
  }
  const capture::RigidFit now = capture::fit_rigid(rest, there);
  const Inertia present = inertia_of(frame.positions, volumes);
  Vec3d velocity = Vec3d::Zero();
  double volume = 0.0;
  for (std::size_t p = 0; p < frame.velocities.size(); ++p) {
    velocity += volumes[p] * frame.velocities[p];
    volume += volumes[p];
  }
  velocity /= volume;
  Vec3d momentum = Vec3d::Zero();
  for (std::size_t p = 0; p < frame.velocities.size(); ++p) {
    momentum +=
        volumes[p] * (frame.positions[p] - present.center).cross(frame.velocities[p] - velocity);
  }
  const Vec3d spin = present.moment.inverse() * momentum;
  mpm::RigidChange change;
  change.center = now(inertia.center);
  change.rotation = state.rotation * now.rotation.transpose();
  change.shift = state.place - change.center;
  const Vec3d of_center = velocity + spin.cross(change.center - present.center);
  change.velocity = state.velocity - change.rotation * of_center;
  change.spin = state.spin - change.rotation * spin;
  return change;
}

}  // namespace matterfit::job
