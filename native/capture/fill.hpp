// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "capture/mesh.hpp"
#include "mpm/scene.hpp"

namespace matterfit::capture {

/// How a shape is filled with particles.
struct FillOptions {
  double separation = 0.01;  ///< particle separation h [m]: 8 particles in a cell of 2h
  bool jitter = false;       ///< off: regular lattice (solids); on: one jittered a sub-cell (flows)
  std::uint64_t seed = 0;
  /// The lattice's axes and a point that a plane of cell faces goes through on each axis; default:
  /// world axes, the lattice centred in the shape's bounding box.
  Quatd axes = Quatd::Identity();
  std::optional<Vec3d> anchor;
  std::size_t limit = 50'000'000;  ///< particles; more is Error(kInput) with the count
};

/// A shape filled with particles.
struct FilledBody {
  Points positions;
  std::vector<double> volumes;  ///< [m³]; their sum is the shape's volume
  mpm::Lattice lattice;
  double volume = 0.0;   ///< of the shape itself [m³]
  std::string report;    ///< what the fill did, one sentence for the panel
};

}  // namespace matterfit::capture
