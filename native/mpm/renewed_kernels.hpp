// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "material/classical/law_constants.hpp"
#include "material/law_table.hpp"
#include "mpm/kernels.hpp"
#include "mpm/layout.hpp"

namespace matterfit::mpm {

/// Numbers of history a particle of the renewed formulation has: J − 1 of a fluid; else elastic
/// F − I at the reference (9) and the equivalent plastic strain.
[[nodiscard]] constexpr std::size_t renewed_history(bool fluid) { return fluid ? 1 : 10; }
[[nodiscard]] inline std::size_t renewed_history(material::Law law) {
  return renewed_history(material::traits(law).fluid);
}

/// What a particle takes from one reference to the next, besides its history.
struct RenewedCarried {
  static constexpr std::size_t kPlace = 0;     ///< x/dx − base, not yet in a cell of the new grid
  static constexpr std::size_t kVelocity = 3;  ///< relative to the common one [m/s]
  static constexpr std::size_t kAffine = 6;    ///< C [1/s]
  static constexpr std::size_t kAttributes = 15;
};

/// How far particles of a block have gone from their reference, each squared.
template <class S>
struct RenewedDeparture {
  S strain;  ///< ½(FᵀF − I) since then
  S way;     ///< relative to the common one [m²]
};

/// One body of the renewed formulation as its kernels see it (layout.hpp), in world axes.
template <class S>
struct RenewedView {
  const double* displacement;        ///< per node block [3][64], since the reference [m]
  const double* velocity;            ///< per node block [3][64] [m/s]
  const std::uint32_t* block_nodes;  ///< per block: 8 node blocks at (+a, +b, +c), index 4a+2b+c
  const std::uint32_t* slab_chunks;  ///< first chunk of each slab, 4 a block, and the end
  const S* geometry;                 ///< per chunk [4][16]: x/dx − base (3), rest volume [m³]
  S* history;                        ///< per chunk [renewed_history()][16]
  S* maxwell;  ///< per chunk, branch and component [12][16]: G − I and its lost digits; or null
  S* halo;     ///< out, per block [4][216]: forces [N]; momentum and mass where a body enters
  BlockExtremes<S>* extremes;      ///< out, per block: of elastic J
  RenewedDeparture<S>* departure;  ///< out, per block
  S* carried;                      ///< per chunk [RenewedCarried::kAttributes][16]
  double* moved;                   ///< out, per block [3]: what kPlace leaves out [m]
  double common[3];                ///< displacement or velocity of all
  material::LawConstants<S> law;
  S density;
  S dx;
  S dt;  ///< of the flow rule
};

template <class S>
struct RenewedKernels {
  /// Forces −Σ V τ (I+H)⁻ᵀ ∇w of one block of a renewed body; its history advances.
  void (*forces)(const RenewedView<S>& view, std::size_t block);
  /// How far its particles are from their reference, into `departure`.
  void (*departure)(const RenewedView<S>& view, std::size_t block);
  /// From the nodes into `carried`, `moved`, history and branches.
  void (*leave)(const RenewedView<S>& view, std::size_t block);
  /// From `carried` into `halo`.
  void (*enter)(const RenewedView<S>& view, std::size_t block);
};

/// Those of an instruction set, as kernels().
template <class S>
[[nodiscard]] const RenewedKernels<S>& renewed_kernels(SimdTarget target);

}  // namespace matterfit::mpm
