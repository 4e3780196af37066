// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <cmath>

#include "base/error.hpp"
#include "capture/fill_lattice.hpp"
#include "capture/limit_surface.hpp"
#include "shape/mesh_distance.hpp"

namespace matterfit::capture {
namespace {

class MeshShape final : public FillShape {
 public:
  MeshShape(std::vector<shape::Triangle> triangles, std::vector<Vec3f> vertices)
      : mesh_(std::move(triangles), {std::move(vertices)},
              std::numeric_limits<double>::infinity()) {}

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

const char* plural(std::size_t count) { return count == 1 ? "" : "s"; }

FilledBody fill_polygons(const Mesh& mesh, const FillOptions& options, std::string notes) {
  const auto triangles =
      shape::triangulate("Mesh to fill", mesh.vertices, mesh.face_sizes, mesh.face_vertices);
  std::vector<std::vector<Vec3f>> frames{mesh.vertices};
  const shape::MeshTopology found = shape::analyse_topology(triangles, frames);
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
  const MeshShape shape(std::move(closed), std::move(frames[0]));
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
  while (limit.level < 8 && longest / (1 << limit.level) > 0.5 * options.separation &&
         faces * 4 < kMostFaces) {
    ++limit.level;
    faces *= 4;
  }
  return fill_polygons(limit_mesh(cage, limit), options,
                       fmt::format("Limit surface of the cage at level {}.", limit.level));
}

}  // namespace matterfit::capture
