// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_contact.hpp"

#include <algorithm>
#include <cmath>

#include "mpm/node_contact.hpp"
#include "mpm/renewed_sample.hpp"

namespace matterfit::mpm {

/// A block's displacement and velocity, and particles there.
template <class S>
struct RenewedContact<S>::Field {
  BlockField displacement;
  BlockField velocity;
  Vec3d corner;  ///< world position of the block's node (0, 0, 0) at the reference
  double dx;

  struct Particle {
    Vec3d position;
    Vec3d velocity;
    Mat3d gradient;  ///< H
    Mat3d rate;      ///< Σ v ⊗ ∇w
  };
  [[nodiscard]] Vec3d position(const UpdatedPlace<S>& place) const {
    const BlockField::Stencil s = block_stencil(place, dx);
    return place.position(corner, dx) + displacement.at(s);
  }
  [[nodiscard]] Particle particle(const UpdatedPlace<S>& place) const {
    const BlockField::Stencil s = block_stencil(place, dx);
    return {place.position(corner, dx) + displacement.at(s), velocity.at(s),
            displacement.gradient(s), velocity.gradient(s)};
  }
};

template <class S>
RenewedContact<S>::RenewedContact(const Body& body, const Scene& scene,
                                  std::vector<shape::ColliderPtr> colliders)
    : colliders_(std::move(colliders)) {
  for (const shape::ColliderPtr& collider : colliders_) {
    laws_.push_back(resolve_contact(collider->contact(), body, scene.dx));
  }
  for (const double volume : body.volumes) {
    largest_edge_ = std::max(largest_edge_, std::cbrt(volume));
  }
  if (any()) memory_.resize(body.rest.size());
}

template <class S>
void RenewedContact<S>::wake(std::size_t blocks) {
  deepest_ = max_penetration();
  if (any()) blocks_.assign(blocks, {});
}

template <class S>
void RenewedContact<S>::begin_frame(double frame_seconds, double acceleration) {
  frame_seconds_ = frame_seconds;
  acceleration_ = acceleration;
  deepest_ = 0.0;
  for (BlockNear& near : blocks_) {
    near.until = -1e30;
    near.penetration = 0.0;
  }
}

template <class S>
void RenewedContact<S>::look(const RenewedBody<S>& body, std::size_t b, const Field& field,
                             double dx, double time, BlockNear& near) const {
  // Particles that might touch before it is looked again: within a cell of doing so.
  const double margin = dx;
  double closing = 0.0;
  bool animated = false;
  near.particles.clear();
  const double reach = 2.0 * largest_edge_ + margin;
  double gap = 1e30;  // of those left out
  body.for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& place) {
    const typename Field::Particle particle = field.particle(place);
    bool is_near = memory_[body.store().id[slot]].surface >= 0;
    for (const shape::ColliderPtr& collider : colliders_) {
      const shape::SurfacePoint surface = collider->closest(particle.position, time);
      animated = animated || collider->animated();
      closing = std::max(closing, (particle.velocity - surface.velocity).norm());
      if (surface.distance <= reach) {
        is_near = true;
      } else {
        gap = std::min(gap, surface.distance - 2.0 * largest_edge_);
      }
    }
    if (is_near) near.particles.push_back({static_cast<std::uint32_t>(slot), place});
  });
  near.until = time + contact_free_time(gap, closing, acceleration_, frame_seconds_, animated);
}

template <class S>
void RenewedContact<S>::apply(const RenewedBody<S>& body, std::size_t b, const std::uint32_t* nodes,
                              const std::vector<double>& displacement,
                              const std::vector<double>& velocity, double dx, double time,
                              double dt, std::vector<RenewedLoad<S>>& loads,
                              std::vector<RenewedTouch>* touches) {
  loads.clear();
  if (!any()) return;
  BlockNear& near = blocks_[b];
  const bool again = time >= near.until;
  if (!again && near.particles.empty()) return;
  Field field;
  field.dx = dx;
  field.corner = block_origin(body.coordinates()[b], dx);
  field.displacement.gather(nodes, displacement.data());
  field.velocity.gather(nodes, velocity.data());
  if (again) look(body, b, field, dx, time, near);
  for (const Near& at : near.particles) {
    const typename Field::Particle particle = field.particle(at.place);
    ContactMemory& memory = memory_[body.store().id[at.slot]];
    for (std::size_t c = 0; c < colliders_.size(); ++c) {
      const shape::SurfacePoint surface = colliders_[c]->closest(particle.position, time);
      const auto id = static_cast<std::int32_t>(c);
      if (surface.distance > 2.0 * largest_edge_ && memory.surface != id) continue;
      const Mat3d moved = Mat3d::Identity() + particle.gradient;
      ContactPoint point = contact_point(surface, moved * body.elastic(at.slot),
                                         body.volume(at.slot), body.density(), particle.velocity);
      Vec3d face = Vec3d::Zero();
      if (body.wets() && (point.distance < point.radius || memory.surface == id)) {
        // A fluid sticks by its face, and is sheared from there. A solid is told by its centre,
        // whose velocity is the rate of its position to the last digit: nothing creeps.
        face = moved.inverse() * (-point.radius * point.normal);
        point.relative_velocity += particle.rate * face;
      }
      const ContactMemory before = memory;
      const Vec3d force = contact_force(laws_[c], point, id, dt, memory);
      if (touches != nullptr && (before.surface == id || memory.surface == id)) {
        touches->push_back({0, at.place.block, at.slot, static_cast<std::uint32_t>(c), before});
      }
      if (force.isZero(0.0)) continue;
      if (body.wets()) {
        // The normal part at the centre: on the face it would depend on where the face is in its
        // cell (a ball's rebound by 9 %).
        const Vec3d normal = point.normal.dot(force) * point.normal;
        loads.push_back({at.place, normal});
        loads.push_back({at.place, force - normal, face / dx});
      } else {
        loads.push_back({at.place, force});
      }
      near.penetration = std::max(near.penetration, point.radius - point.distance);
    }
  }
}

template <class S>
ContactMemories RenewedContact<S>::memories() const {
  ContactMemories out;
  for (std::size_t p = 0; p < memory_.size(); ++p) {
    if (memory_[p].surface >= 0) out.emplace_back(static_cast<std::uint32_t>(p), memory_[p]);
  }
  return out;
}

template <class S>
void RenewedContact<S>::restore(const ContactMemories& memories) {
  std::fill(memory_.begin(), memory_.end(), ContactMemory{});
  for (const auto& [particle, memory] : memories) memory_[particle] = memory;
}

template <class S>
double RenewedContact<S>::max_penetration() const {
  double deepest = deepest_;
  for (const BlockNear& near : blocks_) deepest = std::max(deepest, near.penetration);
  return deepest;
}

void RenewedNodeContact::apply(std::size_t b, const Vec3i& coordinates, double dx, double time,
                               const double* mass, const double* displacement, double* velocity) {
  if (!any() || time < until_[b]) return;
  const Vec3d origin = coordinates.cast<double>() * (4.0 * dx);
  double gap = 1e30;
  double closing = 0.0;
  bool animated = false;
  for (const shape::ColliderPtr& collider : colliders_) {
    animated = animated || collider->animated();
    for (std::size_t n = 0; n < kBlockNodes; ++n) {
      if (!(mass[n] > 0.0)) continue;
      const Vec3d u(displacement[n], displacement[kBlockNodes + n],
                    displacement[2 * kBlockNodes + n]);
      const Vec3d v(velocity[n], velocity[kBlockNodes + n], velocity[2 * kBlockNodes + n]);
      const shape::SurfacePoint surface =
          collider->closest(position_of_node(origin, dx, n) + u, time);
      gap = std::min(gap, surface.distance);
      closing = std::max(closing, (v - surface.velocity).norm());
      if (surface.distance > kNodeInside * dx) continue;
      const Vec3d after = node_response(collider->contact(), surface, v);
      for (std::size_t c = 0; c < 3; ++c)
        velocity[c * kBlockNodes + n] = after[static_cast<int>(c)];
    }
  }
  if (gap > 0.0) {
    until_[b] = time + contact_free_time(gap, closing, acceleration_, frame_seconds_, animated);
  }
}

template class RenewedContact<float>;
template class RenewedContact<double>;

}  // namespace matterfit::mpm
