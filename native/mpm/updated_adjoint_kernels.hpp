// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>

#include "mpm/adjoint_kernels.hpp"
#include "mpm/updated_record.hpp"

namespace matterfit::mpm {

/// Cotangents of one particle's state between two substeps: in float one line of the cache.
template <class S>
struct alignas(16 * sizeof(S)) UpdatedParticleBar {
  std::array<S, 3> position{};  ///< [1/m] per unit of the number that is differentiated
  std::array<S, 3> velocity{};  ///< of what G2P left; nothing before the substep depends on it
  std::array<S, 9> h{};         ///< of the elastic F, row by row
  S strain{};                   ///< of the equivalent plastic strain
};

/// The adjoint of UpdatedView's substep, of one body in one block: from the cotangents of the nodes
/// of the next substep's grid and of the particles after, to those of this substep's node
/// velocities and of the particles before.
template <class S>
struct UpdatedAdjointView {
  const S* node_velocity[8];  ///< as UpdatedView
  const S* node_bar[27];      ///< [4][64] of the neighbours (UpdatedBlock): momentum, mass; or null
  const KeptChunk<S>* slab[4];  ///< before the substep
  std::uint32_t chunks[4];
  material::LawConstants<S> law;
  S density;
  S dx;
  S dt;
  const S* published;                   ///< as UpdatedView
  S* published_bar;                     ///< as `published`, added to; or null: not asked for
  const S* maxwell;                     ///< before the substep, as UpdatedView; or null
  S* maxwell_bar;                       ///< in and out, as `maxwell`
  UpdatedParticleBar<S>* particle_bar;  ///< in and out, by particle
  S* velocity_bar;                      ///< [3][216], added to
  LawCotangents law_bar;                ///< out
  double log_density;  ///< out: ∂/∂ln ρ through the particles' momentum and mass
};

template <class S>
struct UpdatedAdjointKernels {
  void (*updated_block)(UpdatedAdjointView<S>& view);
  /// The kernel of the published law, a panel of registers at a time.
  void (*updated_published_block)(UpdatedAdjointView<S>& view);
};

/// Those of an instruction set, as kernels().
template <class S>
[[nodiscard]] const UpdatedAdjointKernels<S>& updated_adjoint_kernels(SimdTarget target);

}  // namespace matterfit::mpm
