// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/vec.hpp"
#include "shape/collider.hpp"
#include "shape/keyed.hpp"

namespace matterfit::shape {

/// A polygon mesh in plain arrays.
struct PolygonArrays {
  std::vector<Vec3f> vertices;              ///< [m]
  std::vector<std::int32_t> face_sizes;     ///< corners of each face, ≥ 3
  std::vector<std::int32_t> face_vertices;  ///< concatenated, counter-clockwise from outside
};

struct MeshColliderOptions {
  /// Voxel of the OpenVDB distance grid [m]; 0: a 64th of the longest side of the mesh's box, and
  /// no less than an eighth of the band. The answer does not depend on it, only speed and memory
  /// do.
  double voxel_size = 0.0;
  /// Distances and normals are exact this far from the surface [m]; 0: four voxels. Make it a few
  /// particle separations.
  double band = 0.0;
  /// Distance grids of a deforming collider may take this much in all [bytes].
  double memory_limit = 4e9;
  /// Asked while the collider is made (Error(kCancelled)); not kept. Null: nobody.
  const Interrupter* interrupter = nullptr;
};

/// A closed or open mesh, moved rigidly by `pose`.
///
/// Within the band the distance is that to the nearest point of the triangles themselves (a tree of
/// boxes, started from the distance grid), so it is exact far below the voxel; the grid answers
/// everything farther off, where `closest` returns ±band. The normal is the gradient of that
/// distance: a facet's own normal on a facet. Closed shells may overlap (they join), nest (an inner
/// one that faces inward is a cavity), and be unwelded; one that faces inward by itself is turned.
/// An open shell, such as a terrain, is a sheet with one side: its front is where its normals
/// point, and it holds back what is up to a band deep behind it; nothing is held past its rim.
/// Throws Error(kInput) for arrays that are no mesh and for a grid too large to build.
[[nodiscard]] ColliderPtr make_mesh_collider(std::string name, Contact contact,
                                             const PolygonArrays& mesh, Keyed<Pose> pose,
                                             const MeshColliderOptions& options = {});

/// A mesh whose vertices move: `frames[i]` are world positions [m] of all vertices at `times[i]`
/// [s], ascending; faces as in `faces` (whose own `vertices` are not used). Between two frames the
/// vertices move straight, and the distance is the exact one to the mesh so placed; the velocity is
/// that of the vertices, taken at the nearest point of the nearest triangle. Before the first frame
/// and after the last the mesh stands still. One distance grid a frame, built when first asked for
/// and kept; queries from any number of threads give the same result.
[[nodiscard]] ColliderPtr make_deforming_collider(std::string name, Contact contact,
                                                  const PolygonArrays& faces,
                                                  std::vector<std::vector<Vec3f>> frames,
                                                  std::vector<double> times,
                                                  const MeshColliderOptions& options = {});

}  // namespace matterfit::shape
