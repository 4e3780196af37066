// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_contact.hpp"

#include <algorithm>
#include <cmath>

#include "mpm/total_block.hpp"

namespace matterfit::mpm {

template <class S>
TotalContact<S>::TotalContact(const Body& body, const Scene& scene, const TotalBody<S>& total)
    : density_(body.density) {
  response_ = scene.colliders.empty() ? 0.0 : total.grid().contact_response();
  for (const shape::ColliderPtr& collider : scene.colliders) {
    animated_ = animated_ || collider->animated();
    colliders_.push_back({collider, resolve_contact(collider->contact(), body, scene.dx)});
  }
  wake_time_.assign(total.blocks(), 0.0);
  penetration_.assign(total.blocks(), 0.0);
  work_.assign(total.blocks(), 0.0);
  if (colliders_.empty()) return;
  memory_.resize(total.particles());
  skin_.resize(total.blocks());
  for (std::size_t b = 0; b < total.blocks(); ++b) {
    for (const std::uint32_t p : total.block_particles(b)) {
      if (total.is_surface(p)) skin_[b].push_back(p);
    }
    all_skin_.insert(all_skin_.end(), skin_[b].begin(), skin_[b].end());
  }
  std::sort(all_skin_.begin(), all_skin_.end());
}

template <class S>
void TotalContact<S>::wake(double frame_seconds, double acceleration) {
  frame_seconds_ = frame_seconds;
  acceleration_ = acceleration;
  std::fill(wake_time_.begin(), wake_time_.end(), -1e30);
  std::fill(penetration_.begin(), penetration_.end(), 0.0);
  std::fill(work_.begin(), work_.end(), 0.0);
}

template <class S>
void TotalContact<S>::apply(Arena& arena, TotalBody<S>& body, const TotalSubstep& substep) {
  if (colliders_.empty()) return;
  const double time = substep.time;
  const double dt = substep.dt;
  arena.parallel_for(0, skin_.size(), 1, [&](std::size_t b) {
    if (skin_[b].empty() || time < wake_time_[b]) return;
    double gap = 1e30;     // least distance of any particle's surface to any collider
    double closing = 0.0;  // fastest approach seen [m/s]
    bool touching = false;
    const TotalBlock<S> block(body, b);
    for (const std::uint32_t p : skin_[b]) {
      const auto center = body.place(p);
      const auto state = block.state(center);
      const double half = 0.5 * std::cbrt(body.volume(p));
      for (std::size_t s = 0; s < colliders_.size(); ++s) {
        const shape::SurfacePoint surface = colliders_[s].collider->closest(state.position, time);
        const auto id = static_cast<std::int32_t>(s);
        closing = std::max(closing, (state.velocity - surface.velocity).norm());
        // Twice the rest size covers stretches up to two; beyond, F is looked at anyway.
        if (surface.distance > 4.0 * half && memory_[p].surface != id) {
          gap = std::min(gap, surface.distance - 4.0 * half);
          continue;
        }
        // Gap and force are those of the particle's face: a force at its centre would leave the
        // layer outside of it without stress.
        const Mat3d f = block.deformation_gradient(center);
        const auto at_face = body.face(p, -(f.transpose() * surface.normal).normalized());
        const auto face_state = block.state(at_face);
        const shape::SurfacePoint below =
            colliders_[s].collider->closest(face_state.position, time);
        ContactPoint point = contact_point(below, f, body.volume(p), density_, face_state.velocity);
        point.radius = 0.0;
        const Vec3d force = contact_force(colliders_[s].law, point, id, dt, memory_[p]);
        if (!force.isZero(0.0)) {
          body.add_load(p, at_face, force);
          work_[b] += dt * force.dot(face_state.velocity);
          touching = true;
          penetration_[b] = std::max(penetration_[b], point.radius - point.distance);
        }
        gap = std::min(gap, point.distance);
      }
    }
    if (touching || gap <= 0.0) return;
    wake_time_[b] =
        time + contact_free_time(gap, closing, acceleration_, frame_seconds_, animated_);
  });
}

template <class S>
double TotalContact<S>::frequency_squared(double pressure) const {
  double highest = 0.0;
  for (const Surface& surface : colliders_) {
    highest =
        std::max(highest, surface.law.stiffness * firmness(surface.law, pressure) * response_);
  }
  return highest;
}

template <class S>
double TotalContact<S>::max_penetration() const {
  double deepest = 0.0;
  for (const double p : penetration_) deepest = std::max(deepest, p);
  return deepest;
}

template <class S>
double TotalContact<S>::work() const {
  double sum = 0.0;
  for (const double w : work_) sum += w;
  return sum;
}

template <class S>
ContactState TotalContact<S>::record() const {
  ContactState state;
  state.wake_time = wake_time_;
  state.frame_seconds = frame_seconds_;
  state.acceleration = acceleration_;
  for (const std::uint32_t p : all_skin_) {
    if (memory_[p].surface >= 0) state.memory.emplace_back(p, memory_[p]);
  }
  return state;
}

template <class S>
void TotalContact<S>::restore(const ContactState& state) {
  wake_time_ = state.wake_time;
  frame_seconds_ = state.frame_seconds;
  acceleration_ = state.acceleration;
  for (const std::uint32_t p : all_skin_) memory_[p] = {};
  for (const auto& [particle, remembered] : state.memory) memory_[particle] = remembered;
}

template <class S>
void TotalContact<S>::save(ByteWriter& out) const {
  out.put(memory_);
}

template <class S>
void TotalContact<S>::load(ByteReader& in) {
  in.get_same_size(memory_);
}

template class TotalContact<float>;
template class TotalContact<double>;

}  // namespace matterfit::mpm
