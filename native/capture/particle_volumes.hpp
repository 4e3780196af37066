// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <openvdb/openvdb.h>

#include <memory>
#include <vector>

#include "base/vec.hpp"
#include "capture/fill.hpp"

namespace matterfit::capture {

/// A cell of a lattice that a shape's surface cuts.
struct CutCell {
  openvdb::Coord cell;
  double fraction = 0.0;           ///< of it that is inside, above 0 and below 1
  Vec3d centroid = Vec3d::Zero();  ///< of that, nearly, about the cell's middle, in cells
};

/// Which cells of a lattice get a particle, and the volume of each in cells, by the rule of
/// fill.hpp. `parts`: of every cell that is inside, active where it is not 0; `cuts`: those of them
/// below 1.
[[nodiscard]] std::unique_ptr<openvdb::FloatTree> particle_volumes(const openvdb::FloatTree& parts,
                                                                   const std::vector<CutCell>& cuts,
                                                                   const FillOptions& options);

}  // namespace matterfit::capture
