// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace matterfit::mpm {

/// The one place that states how particles and nodes lie in memory, for both formulations.
///
/// *Cells* are the knot spans of the quadratic B-splines: particles of one cell share their 27
/// nodes (cell i spans nodes i, i+1, i+2 and the interval [i+½, i+3/2] dx). *Blocks* are 4×4×4
/// cells and 4×4×4 nodes. A *slab* is the 16 cells of a block with one x index; lane 4y + z of a
/// register is cell (x, y, z). Particles are stored in *chunks*: a chunk holds one particle of each
/// of a slab's 16 cells (or none: volume 0), attribute by attribute, 16 values each (AoSoA-16). A
/// slab with n particles in its fullest cell has n chunks ("slots").
///
/// So the lanes of a register are neighbouring cells: node values are loaded and stored
/// contiguously (no gather, no scatter, no conflict), sums over a cell are vertical, and the tensor
/// product of the B-spline weights is contracted axis by axis. Node values of the 6³ nodes that a
/// block touches are *expanded*: nine copies, shifted by 0, 1, 2 nodes along y and along z and four
/// by four wide, so that the nodes of 16 cells are one aligned register for each of the 27 stencil
/// places. (Three copies, shifted along z alone, hold the same, but their registers overlap: loads
/// wait for the stores before them, which costs a factor of two.)
///
/// Each block adds into its own expanded copy; copies of neighbouring blocks are summed afterwards
/// in a fixed order. No atomics, no colours, two barriers a substep, the same bits for any number
/// of threads.
inline constexpr std::size_t kLanes = 16;
inline constexpr std::size_t kSlabs = 4;
inline constexpr std::size_t kBlockNodes = 64;
inline constexpr std::size_t kHaloNodes = 216;         ///< 6³, those that a block touches
inline constexpr std::size_t kExpanded = 54 * kLanes;  ///< numbers of one expanded component

/// Index into one expanded component for the register of slab `x`, stencil place (di, dj, dk).
[[nodiscard]] constexpr std::size_t expanded_index(std::size_t x, std::size_t dj, std::size_t dk) {
  return ((dk * 3 + dj) * 6 + x) * kLanes;
}

/// Node (x, y, z) of a block, each 0…3.
[[nodiscard]] constexpr std::size_t node_index(std::size_t x, std::size_t y, std::size_t z) {
  return (x * 4 + y) * 4 + z;
}

/// Node (x, y, z) of a block with its halo, each 0…5.
[[nodiscard]] constexpr std::size_t halo_index(std::size_t x, std::size_t y, std::size_t z) {
  return (x * 6 + y) * 6 + z;
}

/// Fields of three components over nodes: node blocks × [3][64].
inline constexpr std::size_t kNodeBlock = 3 * kBlockNodes;
[[nodiscard]] constexpr std::size_t component_of(std::size_t node, std::size_t component) {
  return (node / kBlockNodes * 3 + component) * kBlockNodes + node % kBlockNodes;
}
/// The node whose component place i of such a field is.
[[nodiscard]] constexpr std::size_t node_of(std::size_t i) {
  return i / kNodeBlock * kBlockNodes + i % kBlockNodes;
}

inline constexpr std::uint32_t kNoBlock = 0xffffffffU;

}  // namespace matterfit::mpm
