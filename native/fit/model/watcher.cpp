// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/watcher.hpp"

#include <algorithm>
#include <utility>

#include "base/error.hpp"
#include "fit/data/metrics.hpp"
#include "fit/data/surface_points.hpp"

namespace matterfit::fit {
namespace {

/// Upper limit on particles that cloud losses compare; more cost time and hardly reduce the
/// variance.
constexpr std::size_t kMostParticles = 8192;

std::vector<std::size_t> drawn(std::size_t all) {
  return draw(all, std::min(all, kMostParticles), 0);
}

/// What the surface loss looks at, at rest.
Points surface_of(const mpm::Body& body, Arena& arena) {
  if (body.material.traits().fluid) {
    throw_input("fit.loss: \"surface\" follows the surface that body '" + body.name +
                "' has at rest, and a fluid makes new ones: take \"chamfer\".");
  }
  const Points all = surface_points(body.rest, body.volumes, arena);
  if (all.empty()) {
    throw_input("fit.loss: the particles of body '" + body.name +
                "' have no surface: take \"chamfer\".");
  }
  Points chosen;
  for (const std::size_t i : drawn(all.size())) chosen.push_back(all[i]);
  return chosen;
}

}  // namespace

Points watched_points(const mpm::Scene& scene, const Capture& capture, Loss loss, Arena& arena) {
  if (loss != Loss::kSurface) return capture.input.rest;
  return surface_of(scene.bodies[body_index(scene, capture.input.body)], arena);
}

Watcher::Watcher(const mpm::Scene& scene, const CaptureInput& capture, Loss loss, Points rest,
                 Arena& arena)
    : body_(body_index(scene, capture.body)) {
  const mpm::Body& of = scene.bodies[body_];
  if (loss == Loss::kChamfer) {
    particles_ = drawn(of.rest.size());
  } else {
    points_.emplace(of, capture, std::move(rest), 0.5 * scene.dx, arena);
  }
}

Points Watcher::positions(const mpm::Scene& scene, const mpm::ObservedFrame& frame,
                          Arena& arena) const {
  const mpm::ObservedFrame::Body& state = frame.bodies[body_];
  if (points_) return points_->positions(scene.bodies[body_], state, arena);
  Points seen;
  seen.reserve(particles_.size());
  for (const std::size_t p : particles_) seen.push_back(state.positions[p]);
  return seen;
}

Points Watcher::velocities(const mpm::ObservedFrame& frame, Arena& arena) const {
  const mpm::ObservedFrame::Body& state = frame.bodies[body_];
  if (points_) return points_->velocities(state, arena);
  Points seen;
  seen.reserve(particles_.size());
  for (const std::size_t p : particles_) seen.push_back(state.velocities[p]);
  return seen;
}

}  // namespace matterfit::fit
