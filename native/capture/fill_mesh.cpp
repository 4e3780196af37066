// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "base/error.hpp"
#include "capture/fill_lattice.hpp"
#include "capture/limit_surface.hpp"
#include "shape/mesh_distance.hpp"

namespace matterfit::capture {
namespace {

class MeshShape final : public FillShape {
 public:
  MeshShape(std::vector<shape::Triangle> triangles, std::vector<Vec3f> vertices,
            const Interrupter* interrupter)
      : mesh_(std::move(triangles), {std::move(vertices)}, std::numeric_limits<double>::infinity(),
              interrupter) {}

  [[nodiscard]] Surface at(const Vec3d& x) const override {
    const auto hit = mesh_.at(x);
    return {hit.distance, hit.normal};
  }
  [[nodiscard]] bool inside(const Vec3d& x, const Surface&) const override {
    return mesh_.winding(x) > 0.5;
  }
  [[nodiscard]] Eigen::AlignedBox3d box(const Quatd& axes) const override {
    Eigen::AlignedBox3d box;
    for (std::size_t s = 0; s < mesh_.shell_count(); ++s) box.extend(shell_box(s, axes));
    return box;
  }
  /// Known where every shell is a clean closed one and no two can overlap.
  [[nodiscard]] std::optional<double> volume() const override {
    if (mesh_.topology().boundary_edges > 0 || mesh_.topology().non_manifold_edges > 0 ||
        mesh_.shell_count() > 1000) {
      return std::nullopt;
    }
    double sum = 0;
    for (std::size_t a = 0; a < mesh_.shell_count(); ++a) {
      sum += mesh_.volume(a);
      if (mesh_.kind(a) == shape::MeshDistance::Kind::kCavity) continue;
      for (std::size_t b = 0; b < a; ++b) {
        if (mesh_.kind(b) == shape::MeshDistance::Kind::kCavity) continue;
        if (shell_box(a, Quatd::Identity()).intersects(shell_box(b, Quatd::Identity()))) {
          return std::nullopt;
        }
      }
    }
    if (!(sum > 0)) return std::nullopt;
    return sum;
  }
  [[nodiscard]] const shape::MeshDistance& mesh() const { return mesh_; }

 private:
  [[nodiscard]] Eigen::AlignedBox3d shell_box(std::size_t shell, const Quatd& axes) const {
    Eigen::AlignedBox3d box;
    const Quatd inverse = axes.conjugate();
    for (const std::int32_t t : mesh_.tree(shell).members()) {
      for (const std::int32_t v : mesh_.topology().triangles[static_cast<std::size_t>(t)]) {
        box.extend(inverse * mesh_.frames()[0][static_cast<std::size_t>(v)].cast<double>());
      }
    }
    return box;
  }

  shape::MeshDistance mesh_;
};

/// How far facets of a cage's limit surface may lie from it, in separations: at nearly all of their
/// edges, and where it folds.
constexpr double kFacetDepth = 0.01;
constexpr double kFoldDepth = 0.1;
constexpr double kNearlyAll = 0.95;
constexpr float kInfinitelySharp = 10.0F;
constexpr double kCreased = 0.5;  // cosine: a larger angle is a crease where there are some

/// How deep facets whose corners lie on a smooth surface lie below it, by the angles between them:
/// θ w / 8 for facets of width w that turn by θ. The largest of kFacetDepth and kFoldDepth that it
/// reaches, as a multiple of these.
double facet_depth(const Mesh& facets, bool creased, double separation) {
  struct Side {
    std::uint64_t edge;
    std::size_t face;
  };
  const auto corner = [&](std::size_t i) {
    return facets.vertices[static_cast<std::size_t>(facets.face_vertices[i])].cast<double>();
  };
  std::vector<Side> sides;
  std::vector<Vec3d> areas;  // as normals
  sides.reserve(facets.face_vertices.size());
  areas.reserve(facets.face_sizes.size());
  std::size_t first = 0;
  for (const std::int32_t size : facets.face_sizes) {
    const auto count = static_cast<std::size_t>(size);
    Vec3d area = Vec3d::Zero();
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t next = first + (i + 1) % count;
      area += 0.5 * (corner(first + i) - corner(first)).cross(corner(next) - corner(first));
      const auto a = static_cast<std::uint64_t>(facets.face_vertices[first + i]);
      const auto b = static_cast<std::uint64_t>(facets.face_vertices[next]);
      sides.push_back({std::min(a, b) << 32U | std::max(a, b), areas.size()});
    }
    areas.push_back(area);
    first += count;
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return a.edge != b.edge ? a.edge < b.edge : a.face < b.face;
  });
  std::vector<double> depths;
  for (std::size_t i = 0, next = 0; i < sides.size(); i = next) {
    while (next < sides.size() && sides[next].edge == sides[i].edge) ++next;
    if (next != i + 2) continue;
    const Vec3d& one = areas[sides[i].face];
    const Vec3d& other = areas[sides[i + 1].face];
    const double turn = std::atan2(one.cross(other).norm(), one.dot(other));
    if (creased && std::cos(turn) < kCreased) continue;
    const Vec3d along = facets.vertices[sides[i].edge >> 32U].cast<double>() -
                        facets.vertices[sides[i].edge & 0xffffffffU].cast<double>();
    const double length = along.norm();
    if (!(length > 0)) continue;
    depths.push_back(turn * 0.5 * (one.norm() + other.norm()) / length / 8);
  }
  if (depths.empty()) return 0.0;
  std::sort(depths.begin(), depths.end());
  const double most = depths[static_cast<std::size_t>(kNearlyAll * double(depths.size() - 1))];
  return std::max(most / kFacetDepth, depths.back() / kFoldDepth) / separation;
}

const char* plural(std::size_t count) { return count == 1 ? "" : "s"; }

FilledBody fill_polygons(const Mesh& mesh, const FillOptions& options, std::string notes) {
  const auto triangles =
      shape::triangulate("Mesh to fill", mesh.vertices, mesh.face_sizes, mesh.face_vertices);
  std::vector<std::vector<Vec3f>> frames{mesh.vertices};
  look_at_cancel(options);
  const shape::MeshTopology found = shape::analyse_topology(triangles, frames, options.interrupter);
  look_at_cancel(options);
  const auto note = [&](const std::string& text) { notes += (notes.empty() ? "" : " ") + text; };
  if (found.triangles.empty()) {
    throw_input("Mesh to fill: every face is degenerate (two of its corners are the same).");
  }
  if (found.welded_vertices > 0) {
    note(fmt::format("{} corners that coincide were joined.", found.welded_vertices));
  }
  if (found.turned_triangles > 0) {
    note(fmt::format("{} triangles faced the other way than their neighbours and were turned.",
                     found.turned_triangles));
  }
  std::size_t holes = 0;
  std::vector<shape::Triangle> closed = shape::cap_holes(found, frames[0], holes);
  if (holes > 0) {
    note(
        fmt::format("The mesh is not closed: {} boundary edge{} around {} hole{}, filled as if "
                    "each were covered straight across.",
                    found.boundary_edges, plural(found.boundary_edges), holes, plural(holes)));
  }
  if (found.non_manifold_edges > 0) {
    note(fmt::format("{} edge{} with more than two faces.", found.non_manifold_edges,
                     plural(found.non_manifold_edges)));
  }
  look_at_cancel(options);
  const MeshShape shape(std::move(closed), std::move(frames[0]), options.interrupter);
  look_at_cancel(options);
  if (shape.mesh().turned_shells() > 0) {
    note(fmt::format("{} of {} shell{} faced inward and was turned.", shape.mesh().turned_shells(),
                     shape.mesh().shell_count(), plural(shape.mesh().shell_count())));
  }
  return fill_lattice(shape, options, notes);
}

}  // namespace

FilledBody fill_mesh(const Mesh& mesh, const FillOptions& options) {
  return fill_polygons(mesh, options, "");
}

FilledBody fill_cage(const Mesh& cage, const FillOptions& options, int least_level) {
  constexpr std::size_t kMostFaces = 4'000'000;
  double longest = 0;
  std::size_t first = 0;
  for (const std::int32_t size : cage.face_sizes) {
    for (std::int32_t i = 0;
         i < size && first + static_cast<std::size_t>(size) <= cage.face_vertices.size(); ++i) {
      const std::int32_t a = cage.face_vertices[first + static_cast<std::size_t>(i)];
      const std::int32_t b = cage.face_vertices[first + static_cast<std::size_t>((i + 1) % size)];
      const auto count = static_cast<std::int32_t>(cage.vertices.size());
      if (a < 0 || b < 0 || a >= count || b >= count) continue;  // refused by limit_mesh
      longest = std::max(longest, static_cast<double>((cage.vertices[static_cast<std::size_t>(a)] -
                                                       cage.vertices[static_cast<std::size_t>(b)])
                                                          .norm()));
    }
    if (size > 0) first += static_cast<std::size_t>(size);
  }
  LimitOptions limit;
  limit.level = std::clamp(least_level, 1, 8);
  std::size_t faces = (cage.face_vertices.size() << (2 * limit.level)) / 4;
  const auto is_long = [&] { return longest / (1 << limit.level) > 0.5 * options.separation; };
  Mesh facets = limit_mesh(cage, limit);
  const int level = limit.level;
  if (is_long()) {
    // Creases that only a finer level rounds do not show in the angles.
    const bool rounded_later = std::any_of(
        cage.crease_sharpness.begin(), cage.crease_sharpness.end(), [&](float sharpness) {
          return sharpness > float(limit.level) && sharpness < kInfinitelySharp;
        });
    double depth = rounded_later
                       ? std::numeric_limits<double>::infinity()
                       : facet_depth(facets, !cage.crease_sharpness.empty(), options.separation);
    while (limit.level < 8 && is_long() && depth > 1 && faces * 4 < kMostFaces) {
      ++limit.level;
      faces *= 4;
      depth /= 4;
    }
  }
  if (limit.level > level) facets = limit_mesh(cage, limit);
  return fill_polygons(facets, options,
                       fmt::format("Limit surface of the cage at level {}.", limit.level));
}

}  // namespace matterfit::capture
