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

/// One body in the updated Lagrangian formulation: what it is made of, and what its particles
/// remember beside what lies in the grid's blocks (updated_blocks.hpp).
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
  std::vector<S> published;           ///< weights of the published law (UpdatedView); else empty

  /// Sticks to surfaces by its particles' faces, not their centres.
  [[nodiscard]] bool wets() const { return material.traits().wets; }
};

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
