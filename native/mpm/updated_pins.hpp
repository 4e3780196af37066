// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/updated_grid.hpp"
#include "mpm/updated_member.hpp"
#include "mpm/updated_record.hpp"

namespace matterfit::mpm {

/// A pinned particle is this many times as heavy for the grid: its nodes follow the pin.
inline constexpr double kPinWeight = 1e4;

/// Which pin holds each particle: pin + 1, 0: none. Throws Error(kInput) for a pin that holds no
/// part of the body.
[[nodiscard]] std::vector<std::uint8_t> particles_of_pins(const Body& body);

/// Where a pin takes what lies at `rest` (world) by `time`.
[[nodiscard]] Vec3d pin_target(const Pin& pin, const Vec3d& rest, double time);

/// The pin that holds a particle at `time`, or null.
template <class S>
[[nodiscard]] const Pin* holding_pin(const UpdatedMember<S>& member, std::uint32_t particle,
                                     double time) {
  if (member.pin_of.empty()) return nullptr;
  const std::uint8_t k = member.pin_of[particle];
  if (k == 0 || time >= member.pins[k - 1U].release - 1e-12) return nullptr;
  return &member.pins[k - 1U];
}

/// The pinned particles of block `b` at `time`: adds to its halo what takes them to their places in
/// the substep that follows. `holds` gets each of them, if not null.
template <class S>
void apply_updated_pins(UpdatedGrid<S>& grid, const std::vector<UpdatedMember<S>>& members,
                        std::size_t b, double time, double dt, std::vector<UpdatedHold<S>>* holds);

}  // namespace matterfit::mpm
