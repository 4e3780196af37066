// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/follow.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "math/catmull_rom.hpp"

namespace matterfit::job {
namespace {

const Vec3d kUnknown = Vec3d::Constant(std::numeric_limits<double>::quiet_NaN());

/// F is the gradient of the whole motion for elastic laws; plastic ones keep the elastic part only.
bake::BindingGradient gradient_of(const mpm::Body& body) {
  return body.material.is_elastic() ? bake::BindingGradient::kParticle
                                    : bake::BindingGradient::kFitted;
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
  bake::BindingOptions options;
  options.gradient = gradient_of(body);
  if (!known.empty()) binding_.emplace(known, body.rest, separation, options, arena);
}

Points PointFollower::positions(const mpm::Body& body, const mpm::BodyState& state,
                                Arena& arena) const {
  Points all(rest_.size(), kUnknown);
  if (!binding_) return all;
  const Points moved = binding_->positions(bake::particle_view(body, state, separation_), arena);
  for (std::size_t k = 0; k < bound_.size(); ++k) all[bound_[k]] = moved[k];
  return all;
}

double PointFollower::farthest() const { return binding_ ? binding_->farthest().distance : 0.0; }

SimulatedCapture at_times(const std::vector<Points>& frames, std::size_t points,
                          const std::vector<double>& times, double fps) {
  SimulatedCapture result;
  result.times = times;
  result.positions.assign(times.size() * points, kUnknown);
  constexpr double kSameFrame = 1e-6;
  const double last = double(frames.size()) - 1.0;
  for (std::size_t t = 0; t < times.size(); ++t) {
    const double at = times[t] * fps;
    if (at < -kSameFrame || at > last + kSameFrame) {
      ++result.outside;
      continue;
    }
    const double inside = std::clamp(at, 0.0, last);
    const auto below = static_cast<std::size_t>(inside + kSameFrame);
    double s = inside - double(below);
    if (std::abs(s) < kSameFrame) s = 0.0;
    const std::size_t above = std::min(below + 1, frames.size() - 1);
    result.interpolated = result.interpolated || s != 0.0;
    const bool cubic = below > 0 && above + 1 < frames.size() && above > below;
    for (std::size_t i = 0; i < points; ++i) {
      const Vec3d& a = frames[below][i];
      const Vec3d& b = frames[above][i];
      Vec3d& x = result.positions[t * points + i];
      if (s == 0.0) {
        x = a;
      } else if (cubic) {
        x = catmull_rom(frames[below - 1][i], a, b, frames[above + 1][i], s);
      } else {
        x = a + s * (b - a);
      }
    }
  }
  return result;
}

std::size_t body_index(const mpm::Scene& scene, const std::string& name) {
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    if (scene.bodies[b].name == name) return b;
  }
  throw_input("there is no body '" + name + "' in the scene.");
}

}  // namespace matterfit::job
