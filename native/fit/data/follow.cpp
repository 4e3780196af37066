// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/follow.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "math/catmull_rom.hpp"

namespace matterfit::fit {
namespace {

const Vec3d kUnknown = Vec3d::Constant(std::numeric_limits<double>::quiet_NaN());

/// Where a time lies among whole frames.
struct Moment {
  bool inside = false;  ///< from the first frame to the last
  std::size_t below = 0;
  std::size_t above = 0;
  double s = 0.0;  ///< from `below` to `above`
  bool cubic = false;
};

Moment moment(double time, double fps, std::size_t frames) {
  constexpr double kSameFrame = 1e-6;
  const double last = double(frames) - 1.0;
  const double at = time * fps;
  Moment result;
  if (at < -kSameFrame || at > last + kSameFrame) return result;
  const double inside = std::clamp(at, 0.0, last);
  result.inside = true;
  result.below = static_cast<std::size_t>(inside + kSameFrame);
  result.s = inside - double(result.below);
  if (std::abs(result.s) < kSameFrame) result.s = 0.0;
  result.above = std::min(result.below + 1, frames - 1);
  result.cubic = result.below > 0 && result.above + 1 < frames && result.above > result.below;
  return result;
}

void check_finite(const std::string& name, const mpm::ObservedFrame::Body& state) {
  for (std::size_t p = 0; p < state.positions.size(); ++p) {
    const bool finite =
        state.positions[p].allFinite() && state.velocities[p].allFinite() &&
        (state.deformation_gradients.empty() || state.deformation_gradients[p].allFinite());
    if (finite) continue;
    throw_compute("body '" + name + "', particle " + std::to_string(p) +
                  ": its state is not finite numbers, so nothing can be compared with this frame. "
                  "Simulate again with a smaller time step (solver.dt_safety).");
  }
}

}  // namespace

PointFollower::PointFollower(const mpm::Body& body, Points rest, double separation, Arena& arena)
    : rest_(std::move(rest)), separation_(separation) {
  Points known;
  for (std::size_t i = 0; i < rest_.size(); ++i) {
    if (!rest_[i].allFinite()) continue;
    bound_.push_back(i);
    known.push_back(rest_[i]);
  }
  capture::BindingOptions options;
  options.gradient = capture::binding_gradient(body);
  if (!known.empty()) binding_.emplace(known, body.rest, separation, options, arena);
}

PointFollower::PointFollower(const mpm::Body& body, const CaptureInput& capture, Points rest,
                             double separation, Arena& arena)
    : PointFollower(body, capture.front ? Points() : rest, separation, arena) {
  if (!capture.front) return;
  rest_ = std::move(rest);
  anchor_ = body.rest.front();
  front_.emplace(*capture.front, separation);
}

Points PointFollower::positions(const mpm::Body& body, const mpm::BodyState& state,
                                Arena& arena) const {
  if (front_) {
    Points places;
    places.reserve(state.positions.size());
    for (const Vec3f& x : state.positions) places.push_back(x.cast<double>());
    return {front_at(body, front_->reach(places))};
  }
  if (!binding_) return among_all({});
  return among_all(binding_->positions(capture::particle_view(body, state, separation_), arena));
}

Points PointFollower::positions(const mpm::Body& body, const mpm::ObservedFrame::Body& state,
                                Arena& arena) const {
  if (front_) {
    check_finite(body.name, state);
    return {front_at(body, front_->reach(state.positions))};
  }
  if (!binding_) return among_all({});
  check_finite(body.name, state);
  return among_all(binding_->positions(state.positions, state.deformation_gradients, arena));
}

Vec3d PointFollower::front_at(const mpm::Body& body, double reach) const {
  return front_->moved(rest_.front() + body.rest.front() - anchor_, reach);
}

Points PointFollower::velocities(const mpm::ObservedFrame::Body& state, Arena& arena) const {
  if (front_) return {front_->speed(state.positions, state.velocities) * front_->direction()};
  if (!binding_) return among_all({});
  return among_all(binding_->velocities(state.velocities, arena));
}

Points PointFollower::among_all(const Points& followed) const {
  Points all(rest_.size(), kUnknown);
  for (std::size_t k = 0; k < followed.size(); ++k) all[bound_[k]] = followed[k];
  return all;
}

void PointFollower::spread(const Points& bar, const mpm::ObservedFrame::Body& state,
                           std::span<Vec3d> particle_bar,
                           std::span<Mat3d> deformation_gradient_bar) const {
  if (front_) {
    front_->spread(bar.front().dot(front_->direction()), state.positions, particle_bar);
    return;
  }
  if (!binding_) return;
  Points known;
  known.reserve(bound_.size());
  for (const std::size_t i : bound_) known.push_back(bar[i]);
  binding_->spread(known, particle_bar, deformation_gradient_bar);
}

double PointFollower::farthest() const { return binding_ ? binding_->farthest().distance : 0.0; }

SimulatedCapture at_times(const std::vector<Points>& frames, std::size_t points,
                          const std::vector<double>& times, double fps) {
  SimulatedCapture result;
  result.times = times;
  result.positions.assign(times.size() * points, kUnknown);
  for (std::size_t t = 0; t < times.size(); ++t) {
    const Moment at = moment(times[t], fps, frames.size());
    if (!at.inside) {
      ++result.outside;
      continue;
    }
    result.interpolated = result.interpolated || at.s != 0.0;
    for (std::size_t i = 0; i < points; ++i) {
      const Vec3d& a = frames[at.below][i];
      const Vec3d& b = frames[at.above][i];
      Vec3d& x = result.positions[t * points + i];
      if (at.s == 0.0) {
        x = a;
      } else if (at.cubic) {
        x = catmull_rom(frames[at.below - 1][i], a, b, frames[at.above + 1][i], at.s);
      } else {
        x = a + at.s * (b - a);
      }
    }
  }
  return result;
}

void add_at_time(std::vector<Points>& frames, double time, double fps, std::span<const Vec3d> bar) {
  const Moment at = moment(time, fps, frames.size());
  if (!at.inside) return;
  const auto add = [&](std::size_t frame, double weight) {
    if (weight == 0.0) return;
    if (frames[frame].empty()) frames[frame].assign(bar.size(), Vec3d::Zero());
    for (std::size_t i = 0; i < bar.size(); ++i) frames[frame][i] += weight * bar[i];
  };
  if (!at.cubic) {
    add(at.below, 1.0 - at.s);
    add(at.above, at.s);
    return;
  }
  add(at.below - 1, catmull_rom(1.0, 0.0, 0.0, 0.0, at.s));
  add(at.below, catmull_rom(0.0, 1.0, 0.0, 0.0, at.s));
  add(at.above, catmull_rom(0.0, 0.0, 1.0, 0.0, at.s));
  add(at.above + 1, catmull_rom(0.0, 0.0, 0.0, 1.0, at.s));
}

std::vector<Points> frames_bar(std::size_t frames, std::size_t points,
                               const std::vector<double>& times, double fps,
                               const std::vector<Vec3d>& bar) {
  std::vector<Points> result(frames, Points(points, Vec3d::Zero()));
  for (std::size_t t = 0; t < times.size(); ++t) {
    add_at_time(result, times[t], fps, std::span(bar).subspan(t * points, points));
  }
  return result;
}

std::size_t body_index(const mpm::Scene& scene, const std::string& name) {
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    if (scene.bodies[b].name == name) return b;
  }
  throw_input("there is no body '" + name + "' in the scene.");
}

}  // namespace matterfit::fit
