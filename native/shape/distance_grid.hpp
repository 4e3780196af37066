// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "base/interrupter.hpp"
#include "base/vec.hpp"
#include "shape/mesh_distance.hpp"

namespace matterfit::shape {

/// Signed distance of one shell of a mesh at one frame on a sparse OpenVDB grid: a fast first
/// answer that decides whether the exact one is worth asking for.
///
/// OpenVDB's mesh conversion finds the voxels near the surface; their values are then the exact
/// distances of MeshDistance, and OpenVDB's flood fill carries their sign on. So the sign needs no
/// flood through openings narrower than a voxel, and it agrees with MeshDistance by construction.
class DistanceGrid {
 public:
  struct Options {
    double voxel_size = 0.0;                   ///< [m]
    double band = 0.0;                         ///< values are exact this far from the surface [m]
    std::string what;                          ///< begins error messages
    const Interrupter* interrupter = nullptr;  ///< Error(kCancelled) where it is cancelled
  };
  DistanceGrid(const MeshDistance& mesh, std::size_t shell, std::size_t frame,
               const Options& options);
  ~DistanceGrid();
  DistanceGrid(const DistanceGrid&) = delete;
  DistanceGrid& operator=(const DistanceGrid&) = delete;

  /// |distance| at `x` is within [low, high] (high may be infinite). `sign` is that at `x` if
  /// `low` > 0; of an open shell always 1.
  struct Bounds {
    double low = 0.0;
    double high = 0.0;
    double sign = 1.0;
  };
  [[nodiscard]] Bounds bounds(const Vec3d& x) const;
  [[nodiscard]] std::size_t bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace matterfit::shape
