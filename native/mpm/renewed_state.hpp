// SPDX-License-Identifier: GPL-3.0-or-later
// What a gradient keeps of a run of renewed bodies.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "mpm/renewed_grid.hpp"
#include "mpm/renewed_store.hpp"
#include "mpm/total_contact.hpp"

namespace matterfit::mpm {

/// What stays as it is from one renewal to the next.
template <class S>
struct RenewedReference {
  RenewedGrid grid;
  std::vector<double> mass;             ///< node blocks × [64] [kg]
  std::vector<RenewedStore<S>> bodies;  ///< history of those that do not flow; no branches

  [[nodiscard]] std::size_t bytes() const {
    std::size_t bytes = mass.size() * sizeof(double);
    for (const RenewedStore<S>& body : bodies) {
      bytes += body.id.size() * sizeof(body.id[0]) +
               (body.geometry.size() + body.history.size()) * sizeof(S);
    }
    return bytes;
  }
};

/// A group between two substeps.
template <class S>
struct RenewedState {
  struct Body {
    std::vector<S> history;  ///< of what flows, as RenewedStore; else empty
    std::vector<S> maxwell;
    ContactMemories memory;
  };
  std::shared_ptr<const RenewedReference<S>> reference;
  std::vector<double> displacement;  ///< node blocks × [3][64] [m]
  std::vector<double> velocity;      ///< [m/s]
  std::vector<Body> bodies;
  double last_dt = 0.0;
  double min_j = 1.0;
  double acceleration = 0.0;  ///< that contact was told of at the frame's start [m/s²]
  int looks = 1;
  int substeps = 1;
  int substep = 0;
  std::optional<std::vector<double>> planned;  ///< renewals of this frame
  std::vector<double> renewed_at;              ///< in this frame so far

  [[nodiscard]] const std::vector<S>& history(std::size_t member) const {
    return bodies[member].history.empty() ? reference->bodies[member].history
                                          : bodies[member].history;
  }
  /// Without its reference.
  [[nodiscard]] std::size_t bytes() const {
    std::size_t bytes = (displacement.size() + velocity.size()) * sizeof(double);
    for (const Body& body : bodies) {
      bytes += (body.history.size() + body.maxwell.size()) * sizeof(S) +
               body.memory.size() * sizeof(body.memory[0]);
    }
    return bytes;
  }
};

/// A particle at a collider that it touched, or had touched before, in a substep.
struct RenewedTouch {
  std::uint32_t member;
  std::uint32_t block;
  std::uint32_t slot;
  std::uint32_t collider;
  ContactMemory memory;  ///< before
};

/// A substep as it was taken.
struct RenewedSubstep {
  double time = 0.0;
  double dt = 0.0;
  double kick = 0.0;
  Vec3d gravity = Vec3d::Zero();
  bool renewed = false;               ///< at its end
  std::vector<RenewedTouch> touches;  ///< in the order of the forward pass
};

}  // namespace matterfit::mpm
