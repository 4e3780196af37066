// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/vec.hpp"

namespace matterfit::bench {

/// A body given by a formula, in a unit of its own: its thickness is about 1 or 2.
struct ReferenceShape {
  std::string name;
  Vec3d half_extents;  ///< of a box about the origin that holds it
  double volume;
  bool (*inside)(const Vec3d&);
};

/// sphere, box, tee, cross, torus, egg, cylinder, ell, cone (its tip cut off), capsule, ellipsoid,
/// pawn (a cone with a ball on it).
[[nodiscard]] const std::vector<ReferenceShape>& reference_shapes();

/// Points in the shape scaled to `volume` [m³] and turned by `turn`: the cells of a lattice of
/// `spacing` [m] that is not turned with it give one point each at a random place within them, if
/// that is inside. The lowest point lies `clearance` [m] above z = 0, the rest about x = y = 0.
[[nodiscard]] std::vector<Vec3d> sample(const ReferenceShape& shape, double volume,
                                        const Quatd& turn, double spacing, double clearance,
                                        std::uint64_t seed);

}  // namespace matterfit::bench
