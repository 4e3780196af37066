// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/scene.hpp"
#include "mpm/updated_load.hpp"
#include "mpm/updated_member.hpp"

namespace matterfit::mpm {

/// A pinned particle is this many times as heavy for the grid: its nodes follow the pin.
inline constexpr double kPinWeight = 1e4;

/// Which pin holds each particle: pin + 1, 0: none. Throws Error(kInput) for a pin that holds no
/// part of the body.
[[nodiscard]] std::vector<std::uint8_t> particles_of_pins(const Body& body);

/// Where a pin takes what lies at `rest` (world) by `time`.
[[nodiscard]] Vec3d pin_target(const Pin& pin, const Vec3d& rest, double time);

/// A pinned particle, at the start of a substep.
template <class S>
struct UpdatedHold {
  std::uint32_t member;
  std::uint32_t particle;
  UpdatedPlace<S> place;
  S volume;  ///< at rest [m³]
};

/// The pins of a group's bodies: each pinned particle takes to the grid what carries it to its
/// place in the substep that follows.
template <class S>
class UpdatedPins final : public UpdatedLoad<S> {
 public:
  UpdatedPins(const Scene& scene, const std::vector<UpdatedMember<S>>& members);

  [[nodiscard]] bool any() const;
  void act(UpdatedGrid<S>& grid, std::size_t b, const UpdatedMoment& moment,
           UpdatedActsPtr* acts) const override;
  void act_adjoint(Arena& arena, const UpdatedBack<S>& at, const UpdatedActs& acts,
                   UpdatedCotangents<S>& bar, std::vector<double>& velocity_bar) const override;

 private:
  /// A body with pins.
  struct Held {
    std::vector<Pin> pins;
    std::vector<std::uint8_t> pin_of;  ///< per particle: pin + 1, 0: free; empty without pins
    Points rest;
    double density = 0.0;

    /// The pin that holds a particle at `time`, or null.
    [[nodiscard]] const Pin* pin(std::uint32_t particle, double time) const;
  };
  std::vector<Held> held_;  ///< of each member
};

extern template class UpdatedPins<float>;
extern template class UpdatedPins<double>;

}  // namespace matterfit::mpm
