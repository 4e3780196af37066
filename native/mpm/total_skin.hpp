// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "mpm/total_grid.hpp"

namespace matterfit::mpm {

/// Holds the outer nodes of a total Lagrangian body's skin to the motion inside. A node of which
/// the body fills little of the support carries little mass and next to no stiffness: after an
/// impact it flaps, and takes energy from the bounce by an amount that depends on where the body
/// lies in its grid. For four nodes in a row along an axis, one of them lighter than half a full
/// one, the third difference of displacements is the jump of their second derivative across the
/// cells' boundary, and costs
///   ½ γ μ V ((u₃ − 3u₂ + 3u₁ − u₀)/dx)²,  V the volume of the lightest of the four,
/// a ghost penalty (Burman, C. R. Math. 348, 2010; for B-splines on cut cells: Badia, Verdugo and
/// Martín, CMAME 336, 2018) scaled so that no node becomes faster than its mass allows. A sum of
/// squares with constant coefficients: positive whatever the shape of the body, and zero for any
/// affine motion, so that turning costs nothing.
class SkinTies {
 public:
  /// Nodes in `held` (one flag each) are tied to nothing: pins and masses move them.
  SkinTies(const TotalGrid& grid, double density, const std::vector<std::uint8_t>& held);

  /// Adds what the ties of a block's nodes pull with to `force` [3][64], times `modulus` (μ, [Pa]).
  void add_forces(std::size_t node_block, double modulus, const double* displacement,
                  double* force) const;
  [[nodiscard]] bool any() const { return !rows_.empty(); }

 private:
  struct Row {
    std::uint32_t node;
    std::uint32_t first;  ///< of its entries; they end where the next row's begin
  };
  struct Entry {
    std::uint32_t node;
    double stiffness;  ///< per modulus [m]
  };
  std::vector<Row> rows_;  ///< ascending, one more at the end
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> block_rows_;  ///< the first row of each node block, and the end
};

}  // namespace matterfit::mpm
