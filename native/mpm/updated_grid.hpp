// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mpm/updated_blocks.hpp"
#include "mpm/updated_place.hpp"

namespace matterfit::mpm {

/// The sparse grid with its particles, and what is done there a particle at a time.
template <class S>
struct UpdatedGrid {
  double dx;
  UpdatedBlocks<S> blocks;

  UpdatedGrid(double spacing, std::size_t bodies) : dx(spacing), blocks(bodies) {}

  [[nodiscard]] Vec3d origin(std::size_t block) const { return blocks.origin(block, dx); }
  [[nodiscard]] UpdatedPlace<S> place(std::size_t block, std::size_t slab,
                                      const UpdatedChunk<S>& chunk, std::size_t lane) const {
    using Chunk = UpdatedChunk<S>;
    return {static_cast<std::uint32_t>(block),
            static_cast<std::uint32_t>(slab * kLanes + lane),
            {chunk.a[Chunk::kF][lane], chunk.a[Chunk::kF + 1][lane], chunk.a[Chunk::kF + 2][lane]}};
  }
  [[nodiscard]] Vec3d position(const UpdatedPlace<S>& place) const {
    return place.position(origin(place.block), dx);
  }
  /// Adds momentum and mass at the nodes of a particle, `offset` [m] from it.
  void add_momentum(const UpdatedPlace<S>& place, const Eigen::Matrix<S, 3, 1>& momentum, S mass,
                    const Vec3d& offset = Vec3d::Zero());
  /// Adds the momentum M ∇w_I, `m` M [kg m²/s], at the nodes of a particle.
  void add_gradient_momentum(const UpdatedPlace<S>& place, const Mat3d& m);
  /// Adds the momentum m (v + G (x_I − x)) and the mass m [kg] at the nodes of a particle.
  void add_affine_momentum(const UpdatedPlace<S>& place, double mass, const Vec3d& velocity,
                           const Mat3d& gradient);
  /// ∇v of the nodes at a particle [1/s], before this substep's contacts.
  [[nodiscard]] Mat3d velocity_gradient(const UpdatedPlace<S>& place) const;
};

template <class S>
[[nodiscard]] Mat3d deformation_gradient(const UpdatedChunk<S>& chunk, std::size_t lane) {
  Mat3d f = Mat3d::Identity();
  for (std::size_t i = 0; i < 9; ++i) {
    f(static_cast<int>(i / 3), static_cast<int>(i % 3)) +=
        static_cast<double>(chunk.a[UpdatedChunk<S>::kH + i][lane]);
  }
  return f;
}

template <class S>
[[nodiscard]] Vec3d particle_velocity(const UpdatedChunk<S>& chunk, std::size_t lane) {
  const std::size_t from = UpdatedChunk<S>::kVelocity;
  return {static_cast<double>(chunk.a[from][lane]), static_cast<double>(chunk.a[from + 1][lane]),
          static_cast<double>(chunk.a[from + 2][lane])};
}

extern template struct UpdatedGrid<float>;
extern template struct UpdatedGrid<double>;

}  // namespace matterfit::mpm
