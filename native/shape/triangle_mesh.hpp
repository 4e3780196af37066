// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/vec.hpp"

namespace matterfit::shape {

/// Corners of a triangle, counter-clockwise from outside.
using Triangle = std::array<std::int32_t, 3>;

/// Polygons cut into triangles: quads along the diagonal that keeps both halves facing the same
/// way (the shorter one if both do), larger ones by clipping ears in their mean plane. Checks
/// counts and indices; throws Error(kInput) that starts with `what`.
[[nodiscard]] std::vector<Triangle> triangulate(const std::string& what,
                                                std::span<const Vec3f> vertices,
                                                std::span<const std::int32_t> face_sizes,
                                                std::span<const std::int32_t> face_vertices);

/// How the triangles of a mesh hang together. A shell is a set of triangles connected over edges.
struct MeshTopology {
  static constexpr std::int32_t kBoundary = -1;
  static constexpr std::int32_t kNonManifold = -2;

  std::vector<Triangle> triangles;   ///< oriented alike within each shell where possible
  std::vector<std::int32_t> twins;   ///< (T, 3) triangle across edge e → e+1, or a constant
  std::vector<std::int32_t> shells;  ///< (T,) shell of each triangle
  std::vector<std::size_t> shell_boundary;   ///< (S,) boundary edges of each shell
  std::vector<std::int32_t> vertex_offsets;  ///< (V+1,) into vertex_triangles
  std::vector<std::int32_t> vertex_triangles;
  std::size_t boundary_edges = 0;
  std::size_t non_manifold_edges = 0;
  std::size_t welded_vertices = 0;       ///< corners joined because they coincide
  std::size_t turned_triangles = 0;      ///< turned to agree with their neighbours
  std::size_t degenerate_triangles = 0;  ///< left out: two corners coincide

  [[nodiscard]] std::size_t shell_count() const { return shell_boundary.size(); }
};

/// Finds edges, shells and consistent orientation (each shell keeps that of the majority). Where
/// the mesh has boundary edges, corners that coincide in every one of `frames` (arrays of equally
/// many vertices) are joined first if that closes any. Throws Error(kCancelled) soon after that was
/// asked of `interrupter`.
[[nodiscard]] MeshTopology analyse_topology(std::vector<Triangle> triangles,
                                            std::span<const std::vector<Vec3f>> frames,
                                            const Interrupter* interrupter = nullptr);

/// Reverses every triangle of `shell`.
void turn_shell(MeshTopology& topology, std::int32_t shell);

/// Volume enclosed by each shell [m³], negative where triangles face inward; of an open shell, that
/// of the cone over it from its mean corner.
[[nodiscard]] std::vector<double> shell_volumes(const MeshTopology& topology,
                                                std::span<const Vec3f> vertices);

/// Closes each boundary loop with a fan around its mean corner, appended to `vertices`. Returns the
/// triangles with those added, and the number of loops in `holes`.
[[nodiscard]] std::vector<Triangle> cap_holes(const MeshTopology& topology,
                                              std::vector<Vec3f>& vertices, std::size_t& holes);

}  // namespace matterfit::shape
