// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "shape/triangle_mesh.hpp"

namespace matterfit::shape {
namespace {

using Vec2d = Eigen::Vector2d;

double cross(const Vec2d& a, const Vec2d& b, const Vec2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

Vec3d area_vector(const Vec3d& a, const Vec3d& b, const Vec3d& c) { return (b - a).cross(c - a); }

void split_quad(std::span<const Vec3f> vertices, const std::int32_t* face,
                std::vector<Triangle>& out) {
  const auto at = [&](int i) { return Vec3d(vertices[face[i]].cast<double>()); };
  const bool first = area_vector(at(0), at(1), at(2)).dot(area_vector(at(0), at(2), at(3))) >= 0;
  const bool second = area_vector(at(1), at(2), at(3)).dot(area_vector(at(1), at(3), at(0))) >= 0;
  const bool shorter = (at(2) - at(0)).squaredNorm() <= (at(3) - at(1)).squaredNorm();
  if (first == second ? shorter : first) {
    out.push_back({face[0], face[1], face[2]});
    out.push_back({face[0], face[2], face[3]});
  } else {
    out.push_back({face[1], face[2], face[3]});
    out.push_back({face[1], face[3], face[0]});
  }
}

/// Ear clipping (Meisters 1975) in the plane of Newell's normal; O(n²) but for outlines made to be
/// awkward, because a corner is looked at again only when a neighbour or what blocked it has gone.
void clip_ears(std::span<const Vec3f> vertices, const std::int32_t* face, int size,
               std::vector<Triangle>& out) {
  Vec3d normal = Vec3d::Zero();
  const Vec3d base = vertices[face[0]].cast<double>();
  for (int i = 0; i < size; ++i) {
    const Vec3d a = vertices[face[i]].cast<double>() - base;
    const Vec3d b = vertices[face[(i + 1) % size]].cast<double>() - base;
    normal += a.cross(b);
  }
  if (!(normal.norm() > 0)) normal = Vec3d::UnitZ();
  normal.normalize();
  const Vec3d u = normal.unitOrthogonal();
  const Vec3d v = normal.cross(u);
  std::vector<Vec2d> flat;
  std::vector<int> ring;
  for (int i = 0; i < size; ++i) {
    const Vec3d p = vertices[face[i]].cast<double>() - base;
    flat.emplace_back(p.dot(u), p.dot(v));
    ring.push_back(i);
  }
  const auto at = [&](int i) -> const Vec2d& { return flat[static_cast<std::size_t>(i)]; };
  // How good an ear each corner is, and which corner keeps it from being one.
  constexpr int kNobody = -1;
  std::vector<double> quality(ring.size());
  std::vector<int> blocker(ring.size());
  const auto look = [&](std::size_t i) {
    const std::size_t n = ring.size();
    const int a = ring[(i + n - 1) % n];
    const int b = ring[i];
    const int c = ring[(i + 1) % n];
    const auto corner = static_cast<std::size_t>(b);
    const double area = cross(at(a), at(b), at(c));
    blocker[corner] = area > 0 ? kNobody : b;
    for (std::size_t j = 0; j < n && blocker[corner] == kNobody; ++j) {
      const int p = ring[j];
      if (p == a || p == b || p == c) continue;
      if (cross(at(a), at(b), at(p)) >= 0 && cross(at(b), at(c), at(p)) >= 0 &&
          cross(at(c), at(a), at(p)) >= 0) {
        blocker[corner] = p;
      }
    }
    // Among the ears the roundest; if none is left (the outline crosses itself) the least bad.
    const double edges = (at(a) - at(b)).squaredNorm() + (at(b) - at(c)).squaredNorm() +
                         (at(c) - at(a)).squaredNorm();
    quality[corner] = (edges > 0 ? area / edges : 0.0) - (blocker[corner] == kNobody ? 0.0 : 10.0);
  };
  for (std::size_t i = 0; i < ring.size(); ++i) look(i);
  while (ring.size() > 3) {
    const std::size_t n = ring.size();
    std::size_t best = 0;
    for (std::size_t i = 1; i < n; ++i) {
      if (quality[static_cast<std::size_t>(ring[i])] >
          quality[static_cast<std::size_t>(ring[best])]) {
        best = i;
      }
    }
    const int gone = ring[best];
    out.push_back({face[ring[(best + n - 1) % n]], face[ring[best]], face[ring[(best + 1) % n]]});
    ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(best));
    const std::size_t next = best % ring.size();
    const std::size_t previous = (best + ring.size() - 1) % ring.size();
    for (std::size_t k = 0; k < ring.size(); ++k) {
      if (k == next || k == previous || blocker[static_cast<std::size_t>(ring[k])] == gone) look(k);
    }
  }
  out.push_back({face[ring[0]], face[ring[1]], face[ring[2]]});
}

}  // namespace

std::vector<Triangle> triangulate(const std::string& what, std::span<const Vec3f> vertices,
                                  std::span<const std::int32_t> face_sizes,
                                  std::span<const std::int32_t> face_vertices) {
  if (vertices.empty() || face_sizes.empty()) {
    throw_input(what + ": the mesh has " + std::to_string(vertices.size()) + " vertices and " +
                std::to_string(face_sizes.size()) + " faces; it needs at least one face.");
  }
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (!vertices[i].allFinite()) {
      throw_input(what + ": vertex " + std::to_string(i) + " of the mesh is not finite.");
    }
  }
  std::vector<Triangle> out;
  std::size_t first = 0;
  for (std::size_t f = 0; f < face_sizes.size(); ++f) {
    const std::int32_t size = face_sizes[f];
    if (size < 3 || size > 65536 || static_cast<std::size_t>(size) > face_vertices.size() - first) {
      throw_input(what + ": face " + std::to_string(f) + " of the mesh has " +
                  std::to_string(size) + " corners, expected 3 to 65536 within the " +
                  std::to_string(face_vertices.size()) + " listed.");
    }
    const std::int32_t* face = face_vertices.data() + first;
    for (std::int32_t i = 0; i < size; ++i) {
      if (face[i] < 0 || static_cast<std::size_t>(face[i]) >= vertices.size()) {
        throw_input(what + ": face " + std::to_string(f) + " of the mesh names vertex " +
                    std::to_string(face[i]) + ", but there are " + std::to_string(vertices.size()) +
                    ".");
      }
    }
    if (size == 3) {
      out.push_back({face[0], face[1], face[2]});
    } else if (size == 4) {
      split_quad(vertices, face, out);
    } else {
      clip_ears(vertices, face, size, out);
    }
    first += static_cast<std::size_t>(size);
  }
  if (first != face_vertices.size()) {
    throw_input(what + ": faces of the mesh use " + std::to_string(first) + " corners, but " +
                std::to_string(face_vertices.size()) + " are listed.");
  }
  return out;
}

}  // namespace matterfit::shape
