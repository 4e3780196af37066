// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <tuple>
#include <unordered_set>
#include <vector>

#include "base/vec.hpp"
#include "mpm/cell_hash.hpp"

namespace matterfit::mpm {

/// The order in which cells and blocks are kept.
[[nodiscard]] inline bool before(const Vec3i& a, const Vec3i& b) {
  return std::tie(a[0], a[1], a[2]) < std::tie(b[0], b[1], b[2]);
}

/// What a quadrature point stands for.
enum class PointKind : std::uint8_t {
  kGauss,  ///< an eighth of a full cell
  kPiece,  ///< a particle's share of the cell it lies in
};

/// Where the stress of a total Lagrangian body is evaluated.
struct QuadraturePoint {
  Vec3i cell;              ///< its base node
  Vec3d f;                 ///< x/dx − base, ½ … 3/2 in its cell
  double volume;           ///< at rest [m³]
  std::uint32_t particle;  ///< whose share it is, or the nearest one
  PointKind kind;
};

struct Quadrature {
  std::vector<QuadraturePoint> points;                      ///< sorted by cell
  std::unordered_set<std::array<int, 3>, CellHash> filled;  ///< cells that hold a part of the body
  std::vector<Vec3i> cells;                                 ///< per particle: the cell it lies in
  std::vector<std::uint32_t> nearest;  ///< per particle: the point nearest to it in its cell

  /// The cell, or `otherwise` if it holds nothing of the body.
  [[nodiscard]] Vec3i cell_at(const Vec3i& cell, const Vec3i& otherwise) const;
};

/// Quadrature of a body, cell by cell. `coordinates` are the particles' in node units (a node is an
/// integer), `edge` the edge of each particle's box in the same units, or 0 where particles lie on
/// no lattice: then each is a point of its own, in its own cell.
/// - A box that a cell boundary cuts is cut there, because the gradients of the B-splines have a
///   kink at it: ∫ ∇w is then exact for any place of the lattice in the grid, and a constant stress
///   balances its surface tractions.
/// - Cells that are full take their eight Gauss points, exact for cubics.
[[nodiscard]] Quadrature cell_quadrature(const std::vector<Vec3d>& coordinates,
                                         const std::vector<double>& volumes, double edge);

}  // namespace matterfit::mpm
