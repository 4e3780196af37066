// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "mpm/contact_law.hpp"
#include "mpm/kernels.hpp"
#include "mpm/scene.hpp"

namespace matterfit::mpm {

/// Part of an attached mass.
struct CarriedMass {
  double mass;    ///< [kg]
  double attach;  ///< seconds after the scene's first frame from which it is there
};

/// What each particle carries of a body's attached masses.
struct CarriedMasses {
  std::vector<std::uint32_t> first;  ///< of each particle's `masses`, and the end; empty: none
  std::vector<CarriedMass> masses;

  /// On a particle at `time` [kg].
  [[nodiscard]] double at(std::uint32_t particle, double time) const {
    double sum = 0.0;
    for (std::uint32_t i = first[particle]; i < first[particle + 1]; ++i) {
      if (time >= masses[i].attach - 1e-12) sum += masses[i].mass;
    }
    return sum;
  }
};

/// One body in the updated Lagrangian formulation: what it is made of, what holds it, and what its
/// particles remember beside what lies in the grid's blocks (updated_blocks.hpp).
template <class S>
struct UpdatedMember {
  std::size_t index = 0;  ///< into scene.bodies
  std::string name;
  material::Material material;
  material::LawConstants<S> law;
  double density = 0.0;  ///< at rest [kg/m³]
  std::size_t particles = 0;
  std::vector<ContactLaw> contacts;   ///< per particle-wise collider
  std::vector<ContactMemory> memory;  ///< per particle; empty without such colliders
  std::vector<S> maxwell;             ///< per particle and branch [6] (UpdatedView)
  std::vector<Pin> pins;
  std::vector<std::uint8_t> pin_of;  ///< per particle: pin + 1, 0: free; empty without pins
  Points rest;                       ///< kept for pins only
  CarriedMasses carried;

  /// Sticks to surfaces by its particles' faces, not their centres.
  [[nodiscard]] bool wets() const { return material.traits().wets; }
};

/// Throws Error(kInput) for what this formulation does not have, and for a pin that holds nothing.
template <class S>
[[nodiscard]] UpdatedMember<S> make_updated_member(const Body& body, std::size_t index,
                                                   const std::vector<shape::ColliderPtr>& colliders,
                                                   double dx);

/// Where a particle starts: its block, and the particle as one that enters there.
template <class S>
struct UpdatedStart {
  Vec3i block;
  Crosser<S> particle;
};
/// Throws Error(kInput) for a particle too far from the origin for the grid.
template <class S>
[[nodiscard]] UpdatedStart<S> updated_start(const Body& body, std::size_t particle, double dx,
                                            const Vec3d& center);

extern template struct UpdatedMember<float>;
extern template struct UpdatedMember<double>;

}  // namespace matterfit::mpm
