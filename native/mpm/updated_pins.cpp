// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_pins.hpp"

#include <cmath>

#include "base/error.hpp"
#include "mpm/pin_region.hpp"

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
      // Of pins that overlap the one that holds longest counts.
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
void apply_updated_pins(UpdatedGrid<S>& grid, const std::vector<UpdatedMember<S>>& members,
                        std::size_t b, double time, double dt, std::vector<UpdatedHold<S>>* holds) {
  using Chunk = UpdatedChunk<S>;
  for (std::size_t m = 0; m < members.size(); ++m) {
    const UpdatedMember<S>& member = members[m];
    if (member.pin_of.empty()) continue;
    grid.blocks[b].bodies[m].for_each([&](std::size_t s, const Chunk& chunk, std::size_t l) {
      const Pin* p = holding_pin(member, chunk.id[l], time);
      if (p == nullptr) return;
      const UpdatedPlace<S> place = grid.place(b, s, chunk, l);
      const Vec3d target = pin_target(*p, member.rest[chunk.id[l]], time + dt);
      const Vec3d velocity = (target - grid.position(place)) / dt;
      const S mass =
          static_cast<S>(kPinWeight) * static_cast<S>(member.density) * chunk.a[Chunk::kVolume][l];
      grid.add_momentum(place, mass * velocity.cast<S>(), mass);
      if (holds != nullptr) {
        holds->push_back(
            {static_cast<std::uint32_t>(m), chunk.id[l], place, chunk.a[Chunk::kVolume][l]});
      }
    });
  }
}

template void apply_updated_pins<float>(UpdatedGrid<float>&,
                                        const std::vector<UpdatedMember<float>>&, std::size_t,
                                        double, double, std::vector<UpdatedHold<float>>*);
template void apply_updated_pins<double>(UpdatedGrid<double>&,
                                         const std::vector<UpdatedMember<double>>&, std::size_t,
                                         double, double, std::vector<UpdatedHold<double>>*);

}  // namespace matterfit::mpm
