// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_contact.hpp"

#include <algorithm>
#include <cmath>

namespace matterfit::mpm {
namespace {

/// What a block's particles found out about how long it may sleep.
struct Nearness {
  double gap = 1e30;     ///< [m]
  double closing = 0.0;  ///< speed [m/s]
  bool touching = false;
};

template <class S>
UpdatedTouch<S> touch_of(std::size_t member, std::size_t collider, const UpdatedPlace<S>& place,
                         const UpdatedChunk<S>& chunk, std::size_t lane,
                         const ContactMemory& memory) {
  using Chunk = UpdatedChunk<S>;
  UpdatedTouch<S> touch{};
  touch.member = static_cast<std::uint32_t>(member);
  touch.particle = chunk.id[lane];
  touch.collider = static_cast<std::uint32_t>(collider);
  touch.place = place;
  touch.volume = chunk.a[Chunk::kVolume][lane];
  for (std::size_t c = 0; c < 3; ++c) touch.velocity[c] = chunk.a[Chunk::kVelocity + c][lane];
  for (std::size_t c = 0; c < 9; ++c) touch.h[c] = chunk.a[Chunk::kH + c][lane];
  touch.memory = memory;
  return touch;
}

}  // namespace

std::vector<std::size_t> places_of_met(const Scene& scene, bool by_nodes) {
  std::vector<std::size_t> places;
  for (std::size_t c = 0; c < scene.colliders.size(); ++c) {
    const shape::ContactMethod method = scene.colliders[c]->contact().method;
    if ((method == shape::ContactMethod::kNode) == by_nodes) places.push_back(c);
  }
  return places;
}

std::vector<shape::ColliderPtr> colliders_met(const Scene& scene, bool by_nodes) {
  std::vector<shape::ColliderPtr> met;
  for (const std::size_t c : places_of_met(scene, by_nodes)) met.push_back(scene.colliders[c]);
  return met;
}

template <class S>
UpdatedContact<S>::UpdatedContact(const Scene& scene, std::vector<UpdatedMember<S>>& members)
    : members_(members),
      colliders_(colliders_met(scene, false)),
      places_(places_of_met(scene, false)) {
  for (const UpdatedMember<S>& member : members) {
    for (const double volume : scene.bodies[member.index].volumes) {
      largest_edge_ = std::max(largest_edge_, std::cbrt(volume));
    }
  }
}

template <class S>
void UpdatedContact<S>::begin_frame(double frame_seconds, double pull) {
  frame_seconds_ = frame_seconds;
  pull_ = pull;
}

template <class S>
void UpdatedContact<S>::act(UpdatedGrid<S>& grid, std::size_t b, const UpdatedMoment& moment,
                            UpdatedActsPtr* acts) const {
  const double time = moment.time;
  const double dt = moment.dt;
  const double max_speed = moment.max_speed;
  using Chunk = UpdatedChunk<S>;
  UpdatedBlock<S>& block = grid.blocks[b];
  if (time < block.wake_time) return;
  Nearness found;
  // Distances change by no more than the way: one query rules out most colliders for a block.
  const Vec3d middle = grid.origin(b) + Vec3d::Constant(2.5 * grid.dx);
  const double reach = 2.0 * std::sqrt(3.0) * grid.dx + 2.0 * largest_edge_;
  bool animated = false;
  std::vector<std::size_t> near;
  for (std::size_t c = 0; c < colliders_.size(); ++c) {
    const shape::SurfacePoint surface = colliders_[c]->closest(middle, time);
    animated = animated || colliders_[c]->animated();
    if (surface.distance > reach) {
      found.gap = std::min(found.gap, surface.distance - reach);
      found.closing = std::max(found.closing, max_speed + surface.velocity.norm());
    } else {
      near.push_back(c);
    }
  }
  for (std::size_t m = 0; m < members_.size() && !near.empty(); ++m) {
    UpdatedMember<S>& member = members_[m];
    const bool fluid = member.wets();
    block.bodies[m].for_each([&](std::size_t s, const Chunk& chunk, std::size_t l) {
      const UpdatedPlace<S> place = grid.place(b, s, chunk, l);
      const Vec3d x = grid.position(place);
      const Vec3d v = particle_velocity(chunk, l);
      ContactMemory& memory = member.memory[chunk.id[l]];
      for (const std::size_t c : near) {
        const shape::SurfacePoint surface = colliders_[c]->closest(x, time);
        const auto id = static_cast<std::int32_t>(c);
        found.closing = std::max(found.closing, (v - surface.velocity).norm());
        if (surface.distance > 2.0 * largest_edge_ && memory.surface != id) {
          found.gap = std::min(found.gap, surface.distance - 2.0 * largest_edge_);
          continue;
        }
        const double volume = static_cast<double>(chunk.a[Chunk::kVolume][l]);
        ContactPoint point =
            contact_point(surface, deformation_gradient(chunk, l), volume, member.density, v);
        if (fluid && (point.distance < point.radius || memory.surface == id)) {
          // A fluid sticks by its face, and is sheared from there. A solid is told by its centre,
          // whose velocity is the rate of its position to the last digit: nothing creeps.
          point.relative_velocity -= point.radius * (grid.velocity_gradient(place) * point.normal);
        }
        const ContactMemory before = memory;
        const Vec3d force = contact_force(member.contacts[c], point, id, dt, memory);
        if (acts != nullptr && (before.surface == id || memory.surface == id)) {
          UpdatedActsOf<UpdatedTouch<S>>::add(*acts, touch_of(m, c, place, chunk, l, before));
        }
        if (!force.isZero(0.0)) {
          const Vec3d impulse = dt * force;
          if (fluid) {
            // The normal part at the centre: on the face it would depend on where the face is in
            // its cell (a ball's rebound by 9 %).
            const Vec3d normal = point.normal.dot(impulse) * point.normal;
            grid.add_momentum(place, normal.cast<S>(), S(0));
            grid.add_momentum(place, (impulse - normal).cast<S>(), S(0),
                              -point.radius * point.normal);
          } else {
            grid.add_momentum(place, impulse.cast<S>(), S(0));
          }
          found.touching = true;
          block.penetration = std::max(block.penetration, point.radius - point.distance);
        }
        found.gap = std::min(found.gap, surface.distance - point.radius);
      }
    });
  }
  if (found.touching || found.gap <= 0.0) return;
  // Particles come and go: at most a cell's worth of time, whatever is near.
  block.wake_time =
      time + contact_free_time(std::min(found.gap, grid.dx), std::max(found.closing, max_speed),
                               pull_, frame_seconds_, animated);
}

template class UpdatedContact<float>;
template class UpdatedContact<double>;

}  // namespace matterfit::mpm
