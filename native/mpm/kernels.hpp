// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "material/classical/law_constants.hpp"
#include "mpm/layout.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::mpm {

/// What a kernel saw of a block's particles.
template <class S>
struct BlockExtremes {
  S min_volume_ratio;  ///< NaN-proof: a NaN makes it −infinity
  S max_volume_ratio;
};

/// A total Lagrangian body as its force kernel sees it (layout.hpp). Coordinates are the body's
/// own.
template <class S>
struct TotalView {
  const double* displacement;        ///< per node block [3][64], [m]
  const double* velocity;            ///< per node block [3][64], [m/s]; read if damped
  const std::uint32_t* block_nodes;  ///< per block: 8 node blocks at (+a, +b, +c), index 4a+2b+c
  const std::uint32_t* slab_chunks;  ///< first chunk of each slab, 4 a block, and the end
  const S* geometry;                 ///< per chunk [4][16]: x/dx − base (3), rest volume [m³]
  const S* full_volume;              ///< per slab [16]: of each full cell, else 0 [m³]
  const S* piece_volume;  ///< per chunk [16]: of points in the cell they lie in, if not full [m³]
  const std::uint8_t* has_pieces;  ///< per chunk
  S* plastic;                      ///< per chunk [10][16]: Fᵖ⁻¹ − I, plastic strain; or null
  S* maxwell;  ///< per chunk, branch and component [12][16]: G − I and its lost digits
  S* force;    ///< out, per block [3][216]: internal forces [N]
  BlockExtremes<S>* extremes;  ///< out, per block
  material::LawConstants<S> law;
  S density;
  S dx;
  S dt;                  ///< of the flow rule and of `commit`
  bool mean_dilatation;  ///< volume term of each cell's mean J̄, variational
  bool commit;           ///< plastic history advances
};

/// Sixteen particles of the updated Lagrangian formulation, one of each cell of a slab.
template <class S>
struct UpdatedChunk {
  static constexpr std::size_t kF = 0;          ///< x/dx − base, each in [½, 3/2)
  static constexpr std::size_t kH = 3;          ///< elastic F − I
  static constexpr std::size_t kVolume = 12;    ///< at rest [m³]; 0: nobody here
  static constexpr std::size_t kStrain = 13;    ///< equivalent plastic strain
  static constexpr std::size_t kVelocity = 14;  ///< [m/s]
  static constexpr std::size_t kAttributes = 17;
  alignas(64) S a[kAttributes][kLanes];
  std::uint32_t id[kLanes];
};

/// A particle that leaves its cell in a substep, on its way to the next.
template <class S>
struct Crosser {
  std::uint32_t id;
  std::uint16_t chunk;  ///< where it was
  std::uint8_t slab;
  std::uint8_t lane;
  std::uint8_t neighbour;  ///< block it goes to: 9(a+1) + 3(b+1) + (c+1) for the step (a, b, c)
  std::uint8_t cell;       ///< there: slab · 16 + lane
  S f[3];                  ///< relative to the base of its cell
  S velocity[3];
  S affine[9];  ///< C [1/s]
  S h[9];
  S stress[6];  ///< τ: xx, yy, zz, yz, xz, xy [Pa]
  S volume;
  S strain;
};

/// One body in one block, updated Lagrangian.
template <class S>
struct UpdatedView {
  const S* node_velocity[8];  ///< [3][64] of the node blocks at (+a, +b, +c), index 4a+2b+c
  UpdatedChunk<S>* slab[4];
  std::uint32_t chunks[4];
  material::LawConstants<S> law;
  S density;
  S dx;
  S dt;
  S* halo;  ///< in and out: [4][216] momentum (3) and mass, added to
  S* maxwell;  ///< per particle and branch [6]: F̄ G F̄ᵀ − I (material/classical/maxwell-inl.hpp); or
               ///< null
  const S* published;  ///< both nets' weights (material::joined_weights); null: another law
  std::vector<Crosser<S>>* crossers;
  BlockExtremes<S> extremes;  ///< out
  S fastest;                  ///< out: largest displacement along an axis, in cells
};

template <class S>
struct Kernels {
  /// Grid to particles, stress and flow, particles to grid (of the next substep), fused: C and τ
  /// never leave the registers. Particles that change cell go to `crossers` instead of the grid.
  void (*updated_block)(UpdatedView<S>& view);
  /// The same of the published law, in phases: so many registers go from the grid to their trial
  /// states, then through the nets together, then back. A leaver's stress lies in its `affine`.
  void (*updated_published_block)(UpdatedView<S>& view);
  /// Adds one particle to a halo: `cell` is its cell in the block, 0…3 each.
  void (*updated_scatter)(const Crosser<S>& particle, const int cell[3], S density, S dx, S dt,
                          S* halo);
  /// Forces of one block. Equation: f_I = −Σ V P ∇₀w_I + Σ w_I f_p (docs/why.md).
  void (*total_forces)(const TotalView<S>& view, std::size_t block);
  /// Momentum of a block's particles after a transfer to them and back, into `force` [kg m/s].
  void (*total_smooth)(const TotalView<S>& view, std::size_t block);
  /// The mass matrix of a block times the field in `velocity`, into `force`: Σ w m a_p over the
  /// points in the cell whose polynomial moves them, a_p = Σ w a. The weights of the others, which
  /// belong to a host, may be negative; they are left out.
  void (*total_mass)(const TotalView<S>& view, std::size_t block);
};

/// The kernels of an instruction set; kAuto: the best this processor has. Those in double, which
/// check gradients, are the lowest set's. Throws Error(kInput) if the processor lacks it.
template <class S>
[[nodiscard]] const Kernels<S>& kernels(SimdTarget target);

}  // namespace matterfit::mpm
