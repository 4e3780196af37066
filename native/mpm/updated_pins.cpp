// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_pins.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "mpm/pin_region.hpp"
#include "mpm/updated_back.hpp"

namespace matterfit::mpm {

std::vector<std::uint8_t> particles_of_pins(const Body& body) {
  std::vector<std::uint8_t> pin_of(body.rest.size(), 0);
  constexpr std::size_t kMostPins = 250;
  if (body.pins.size() > kMostPins) {
    throw_input("Body '" + body.name + "' has " + std::to_string(body.pins.size()) +
                " pins; an updated body takes 250. Join some, or set formulation to 'total'.");
  }
  for (std::size_t k = 0; k < body.pins.size(); ++k) {
    bool holds = false;
    for (std::size_t p = 0; p < body.rest.size(); ++p) {
      // A plane on the body's end face holds the layer of particles that it touches.
      const double reach =
          body.pins[k].region == Pin::Region::kPlane ? 0.51 * std::cbrt(body.volumes[p]) : 0.0;
      if (region_distance(body.pins[k], body.rest[p]).distance > reach) continue;
      holds = true;
      // Where pins overlap the one that holds longest counts.
      std::uint8_t& of = pin_of[p];
      if (of == 0 || body.pins[k].release >= body.pins[of - 1U].release) {
        of = static_cast<std::uint8_t>(k + 1);
      }
    }
    if (!holds) {
      throw_input("Body '" + body.name + "': pin " + std::to_string(k) +
                  " holds no part of the body. Move its region onto the body.");
    }
  }
  return pin_of;
}

Vec3d pin_target(const Pin& pin, const Vec3d& rest, double time) {
  const shape::Pose pose = pin.motion.at(time);
  return pin.pivot + pose.rotation * (rest - pin.pivot) + pose.position;
}

template <class S>
UpdatedPins<S>::UpdatedPins(const Scene& scene, const std::vector<UpdatedMember<S>>& members) {
  for (const UpdatedMember<S>& member : members) {
    const Body& body = scene.bodies[member.index];
    Held& held = held_.emplace_back();
    if (body.pins.empty()) continue;
    held = {body.pins, particles_of_pins(body), body.rest, member.density};
  }
}

template <class S>
bool UpdatedPins<S>::any() const {
  return std::any_of(held_.begin(), held_.end(),
                     [](const Held& held) { return !held.pins.empty(); });
}

template <class S>
const Pin* UpdatedPins<S>::Held::pin(std::uint32_t particle, double time) const {
  const std::uint8_t k = pin_of[particle];
  if (k == 0 || time >= pins[k - 1U].release - 1e-12) return nullptr;
  return &pins[k - 1U];
}

template <class S>
void UpdatedPins<S>::act(UpdatedGrid<S>& grid, std::size_t b, const UpdatedMoment& moment,
                         UpdatedActsPtr* acts) const {
  using Chunk = UpdatedChunk<S>;
  const double dt = moment.dt;
  for (std::size_t m = 0; m < held_.size(); ++m) {
    const Held& held = held_[m];
    if (held.pins.empty()) continue;
    grid.blocks[b].bodies[m].for_each([&](std::size_t s, const Chunk& chunk, std::size_t l) {
      const Pin* p = held.pin(chunk.id[l], moment.time);
      if (p == nullptr) return;
      const UpdatedPlace<S> place = grid.place(b, s, chunk, l);
      const Vec3d target = pin_target(*p, held.rest[chunk.id[l]], moment.time + dt);
      const Vec3d velocity = (target - grid.position(place)) / dt;
      const S mass =
          static_cast<S>(kPinWeight) * static_cast<S>(held.density) * chunk.a[Chunk::kVolume][l];
      grid.add_momentum(place, mass * velocity.cast<S>(), mass);
      if (acts == nullptr) return;
      UpdatedActsOf<UpdatedHold<S>>::add(
          *acts, {static_cast<std::uint32_t>(m), chunk.id[l], place, chunk.a[Chunk::kVolume][l]});
    });
  }
}

// Momentum M (target − x)/dt and mass M, M = weight · ρ V.
template <class S>
void UpdatedPins<S>::act_adjoint(Arena& /*arena*/, const UpdatedBack<S>& at,
                                 const UpdatedActs& acts, UpdatedCotangents<S>& bar,
                                 std::vector<double>& /*velocity_bar*/) const {
  const double dt = at.dt();
  const double time = at.time();
  for (const UpdatedHold<S>& hold : UpdatedActsOf<UpdatedHold<S>>::of(acts)) {
    const Held& held = held_[hold.member];
    const Pin* pin = held.pin(hold.particle, time);
    if (pin == nullptr) continue;
    UpdatedBodyCotangents<S>& body = bar.bodies[hold.member];
    const Vec3d& rest = held.rest[hold.particle];
    const Vec3d target = pin_target(*pin, rest, time + dt);
    const Vec3d velocity = (target - at.position(hold.place)) / dt;
    const double mass = kPinWeight * held.density * static_cast<double>(hold.volume);
    const GridSums sums = at.sums(hold.place, hold.place.fraction());
    const Vec3d target_bar = mass / dt * sums.momentum;
    const Vec3d rest_bar = pin->motion.at(time + dt).rotation.conjugate() * target_bar;
    body.rest[hold.particle] += rest_bar;
    body.pivots += target_bar - rest_bar;
    body.turn += target.cross(target_bar) - rest.cross(rest_bar);
    body.log_density += mass * (velocity.dot(sums.momentum) + sums.mass);
    add_to<S>(mass * (sums.momentum_by.transpose() * velocity + sums.mass_by) - target_bar,
              body.particles[hold.particle].position);
  }
}

template class UpdatedPins<float>;
template class UpdatedPins<double>;

}  // namespace matterfit::mpm
