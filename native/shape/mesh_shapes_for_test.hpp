// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <utility>

#include "shape/collider_mesh.hpp"

/// Meshes with known geometry, for tests.
namespace matterfit::shape::test_shapes {

inline PolygonArrays box(const Vec3f& low, const Vec3f& high, bool lid = true) {
  PolygonArrays mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.emplace_back((i & 1) ? high.x() : low.x(), (i & 2) ? high.y() : low.y(),
                               (i & 4) ? high.z() : low.z());
  }
  mesh.face_vertices = {0, 2, 3, 1, 0, 1, 5, 4, 0, 4, 6, 2, 1, 3, 7, 5, 2, 6, 7, 3};
  if (lid) mesh.face_vertices.insert(mesh.face_vertices.end(), {4, 5, 7, 6});
  mesh.face_sizes.assign(mesh.face_vertices.size() / 4, 4);
  return mesh;
}

/// Latitudes and longitudes, corners on the sphere.
inline PolygonArrays sphere(const Vec3f& centre, float radius, int rings) {
  PolygonArrays mesh;
  const int around = 2 * rings;
  mesh.vertices.push_back(centre + Vec3f(0, 0, radius));
  for (int r = 1; r < rings; ++r) {
    const double theta = std::numbers::pi * r / rings;
    for (int a = 0; a < around; ++a) {
      const double phi = 2 * std::numbers::pi * a / around;
      mesh.vertices.push_back(centre + radius * Vec3d(std::sin(theta) * std::cos(phi),
                                                      std::sin(theta) * std::sin(phi),
                                                      std::cos(theta))
                                                    .cast<float>());
    }
  }
  mesh.vertices.push_back(centre - Vec3f(0, 0, radius));
  const auto at = [&](int r, int a) { return 1 + (r - 1) * around + a % around; };
  const int last = static_cast<int>(mesh.vertices.size()) - 1;
  for (int a = 0; a < around; ++a) {
    mesh.face_sizes.push_back(3);
    for (const int v : {0, at(1, a), at(1, a + 1)}) mesh.face_vertices.push_back(v);
    for (int r = 1; r + 1 < rings; ++r) {
      mesh.face_sizes.push_back(4);
      for (const int v : {at(r, a), at(r + 1, a), at(r + 1, a + 1), at(r, a + 1)}) {
        mesh.face_vertices.push_back(v);
      }
    }
    mesh.face_sizes.push_back(3);
    for (const int v : {at(rings - 1, a + 1), at(rings - 1, a), last}) {
      mesh.face_vertices.push_back(v);
    }
  }
  return mesh;
}

inline PolygonArrays joined(PolygonArrays a, const PolygonArrays& b) {
  const auto offset = static_cast<std::int32_t>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  a.face_sizes.insert(a.face_sizes.end(), b.face_sizes.begin(), b.face_sizes.end());
  for (const std::int32_t v : b.face_vertices) a.face_vertices.push_back(v + offset);
  return a;
}

inline PolygonArrays inverted(PolygonArrays mesh) {
  std::size_t first = 0;
  for (const std::int32_t size : mesh.face_sizes) {
    std::reverse(mesh.face_vertices.begin() + static_cast<std::ptrdiff_t>(first),
                 mesh.face_vertices.begin() + static_cast<std::ptrdiff_t>(first) + size);
    first += static_cast<std::size_t>(size);
  }
  return mesh;
}

}  // namespace matterfit::shape::test_shapes
