// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/build_scene.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "capture/mesh.hpp"
#include "capture/npz.hpp"
#include "capture/ply.hpp"
#include "job/documents/document_error.hpp"
#include "job/run/observe.hpp"
#include "shape/collider_mesh.hpp"

namespace matterfit::job {
namespace {

shape::PolygonArrays arrays(const capture::Mesh& mesh) {
  return {mesh.vertices, mesh.face_sizes, mesh.face_vertices};
}

effects::Effect build_effect(const EffectDoc& doc, const SceneDoc& scene) {
  effects::Effect effect{doc.type, doc.name, doc.body, {}, {}};
  std::vector<shape::Keyed<double>> keys;
  bool any_keyed = false;
  for (const ByFrame<std::vector<double>>& parameter : doc.values) {
    const auto keyed = parameter.in_seconds(scene.first_frame, scene.fps);
    any_keyed = any_keyed || keyed.animated();
    for (std::size_t c = 0; c < keyed.values.front().size(); ++c) {
      effect.values.push_back(keyed.values.front()[c]);
      keys.emplace_back();
      if (!keyed.animated()) continue;
      keys.back().times = keyed.times;
      keys.back().step = keyed.step;
      for (const std::vector<double>& value : keyed.values) keys.back().values.push_back(value[c]);
    }
  }
  if (any_keyed) effect.keys = std::move(keys);
  return effect;
}

shape::ColliderPtr build_collider(const ColliderDoc& doc, const SceneDoc& scene,
                                  const Interrupter& interrupter) {
  using Shape = ColliderDoc::Shape;
  const auto pose = doc.transform.in_seconds(scene.first_frame, scene.fps);
  shape::MeshColliderOptions mesh;
  mesh.voxel_size = doc.voxel_size;
  // A block of particles is passed over beyond √3·4 + 2 separations (updated_group.cpp).
  mesh.band = 10.0 * scene.particle_separation;
  mesh.memory_limit = 0.5e9 * scene.solver.memory_limit_gb;
  mesh.interrupter = &interrupter;
  switch (doc.shape) {
    case Shape::kGround:
      return shape::make_plane(doc.name, doc.contact, Vec3d(0, 0, doc.height), Vec3d::UnitZ());
    case Shape::kPlane:
      return shape::make_plane(doc.name, doc.contact, doc.point, doc.normal, pose);
    case Shape::kSphere:
      return shape::make_sphere(doc.name, doc.contact, doc.radius, pose);
    case Shape::kBox:
      return shape::make_box(doc.name, doc.contact, doc.half_extents, pose);
    case Shape::kCapsule:
      return shape::make_capsule(doc.name, doc.contact, doc.radius, doc.half_length, pose);
    case Shape::kMesh:
      return shape::make_mesh_collider(doc.name, doc.contact,
                                       arrays(capture::read_mesh(doc.files.front())), pose, mesh);
    case Shape::kMeshes:
      break;
  }
  std::vector<std::vector<Vec3f>> frames;
  std::vector<double> times;
  capture::Mesh first;
  for (std::size_t i = 0; i < doc.files.size(); ++i) {
    capture::Mesh read = capture::read_mesh(doc.files[i]);
    if (i == 0) first = read;
    if (read.vertices.size() != first.vertices.size() ||
        read.face_vertices != first.face_vertices) {
      throw_input(doc.files[i].string() + " has other vertices or faces than " +
                  doc.files[0].string() + "; a deforming collider keeps its topology.");
    }
    frames.push_back(std::move(read.vertices));
    times.push_back(scene.seconds(doc.first_frame + double(i)));
  }
  return shape::make_deforming_collider(doc.name, doc.contact, arrays(first), std::move(frames),
                                        std::move(times), mesh);
}

/// Whether a tenth of a mesh's surface or more has nothing of the collider a separation behind it.
bool has_thin_walls(const capture::Mesh& mesh, const shape::Pose& pose,
                    const shape::Collider& collider, double separation) {
  constexpr std::size_t kMostFaces = 20'000;
  const std::size_t stride = 1 + mesh.face_sizes.size() / kMostFaces;
  double all = 0.0;
  double thin = 0.0;
  std::size_t first = 0;
  for (std::size_t f = 0; f < mesh.face_sizes.size(); ++f) {
    const auto size = static_cast<std::size_t>(mesh.face_sizes[f]);
    const auto corner = [&](std::size_t i) -> Vec3d {
      const auto v = static_cast<std::size_t>(mesh.face_vertices[first + i % size]);
      return mesh.vertices[v].cast<double>();
    };
    Vec3d area = Vec3d::Zero();
    Vec3d centre = Vec3d::Zero();
    for (std::size_t i = 0; i < size; ++i) {
      area += 0.5 * (corner(i) - corner(0)).cross(corner(i + 1) - corner(0));
      centre += corner(i) / double(size);
    }
    first += size;
    if (f % stride != 0 || !(area.norm() > 0.0)) continue;
    const Vec3d behind = separation * area.normalized();
    const auto is_free = [&](const Vec3d& x) {
      return collider.closest(pose.rotation * x + pose.position, 0.0).distance >= 0.0;
    };
    all += area.norm();
    if (is_free(centre - behind) && is_free(centre + behind)) thin += area.norm();
  }
  return thin > 0.1 * all;
}

/// Contact pushes out by the nearest side, which in a thin wall is soon the wrong one.
bool is_thin(const ColliderDoc& doc, const shape::Collider& collider, const SceneDoc& scene) {
  using Shape = ColliderDoc::Shape;
  const double separation = scene.particle_separation;
  switch (doc.shape) {
    case Shape::kGround:
    case Shape::kPlane:
      return false;
    case Shape::kSphere:
    case Shape::kCapsule:
      return 2.0 * doc.radius < separation;
    case Shape::kBox:
      return 2.0 * doc.half_extents.minCoeff() < separation;
    case Shape::kMesh: {
      const auto pose = doc.transform.in_seconds(scene.first_frame, scene.fps).at(0.0);
      return has_thin_walls(capture::read_mesh(doc.files.front()), pose, collider, separation);
    }
    case Shape::kMeshes:
      return has_thin_walls(capture::read_mesh(doc.files.front()), shape::Pose{}, collider,
                            separation);
  }
  return false;
}

}  // namespace

Points read_points(const std::filesystem::path& path) {
  std::vector<double> values;
  if (path.extension() == ".ply") {
    values = capture::ply_positions(capture::read_ply(path), path.string());
  } else {
    const capture::Arrays arrays = capture::read_npz(path);
    const capture::Array& positions = capture::require(arrays, "positions", path.string());
    const auto& shape = positions.shape;
    const bool frames = shape.size() == 3;
    if ((shape.size() != 2 && !frames) || shape.back() != 3 || (frames && shape[0] == 0)) {
      throw_input(path.string() + ": 'positions' has shape " + positions.shape_text() +
                  ", expected (points, 3) or (frames, points, 3).");
    }
    values = positions.doubles(path.string() + ": 'positions'");
    if (frames) values.resize(3 * shape[1]);
  }
  Points points(values.size() / 3);
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i] = Vec3d(values[3 * i], values[3 * i + 1], values[3 * i + 2]);
    if (!points[i].allFinite()) {
      throw_input(path.string() + ": point " + std::to_string(i) + " is not finite.");
    }
  }
  if (points.empty()) throw_input(path.string() + ": there are no points in it.");
  return points;
}

mpm::Pin pin_region(const Region& region) {
  mpm::Pin pin;
  pin.region = static_cast<mpm::Pin::Region>(region.shape);
  pin.point = region.point;
  pin.normal = region.normal;
  pin.low = region.low;
  pin.high = region.high;
  pin.radius = region.radius;
  if (region.shape == Region::Shape::kPoints) pin.points = read_points(region.file);
  return pin;
}

BuiltScene build_scene(const Job& job, Arena& arena, const Interrupter& interrupter) {
  static_assert(static_cast<int>(Region::Shape::kPoints) ==
                static_cast<int>(mpm::Pin::Region::kPoints));
  const SceneDoc& doc = job.scene;
  BuiltScene built;
  mpm::Scene& scene = built.scene;
  scene.fps = doc.fps;
  scene.first_frame = doc.first_frame;
  scene.end_frame = doc.end_frame;
  scene.dx = 2.0 * doc.particle_separation;
  scene.gravity = doc.gravity.in_seconds(doc.first_frame, doc.fps);
  for (std::size_t i = 0; i < doc.bodies.size(); ++i) {
    interrupter.check();
    const std::string path = "scene.bodies[" + std::to_string(i) + "]";
    std::string report;
    scene.bodies.push_back(at_place(
        path, [&] { return build_body(doc.bodies[i], doc, path, report, arena, interrupter); }));
    built.fill_reports.push_back(report);
  }
  for (std::size_t i = 0; i < doc.colliders.size(); ++i) {
    interrupter.check();
    scene.colliders.push_back(at_place("scene.colliders[" + std::to_string(i) + "]", [&] {
      return build_collider(doc.colliders[i], doc, interrupter);
    }));
    if (!is_thin(doc.colliders[i], *scene.colliders.back(), doc)) continue;
    char text[200];
    std::snprintf(text, sizeof text,
                  ": thinner than a particle separation (%.3g m); what presses on it may come out "
                  "on its other side. Thicken it, or use a smaller separation.",
                  doc.particle_separation);
    built.notes.push_back("collider '" + doc.colliders[i].name + "'" + text);
  }
  scene.contacts = doc.contacts;
  scene.walls = doc.walls;
  for (const EffectDoc& effect : doc.effects) scene.effects.push_back(build_effect(effect, doc));
  scene.cfl = doc.solver.cfl;
  scene.dt = doc.solver.dt;
  scene.dt_safety = doc.solver.dt_safety;
  scene.grid_shift = doc.solver.grid_shift;
  for (std::size_t i = 0; i < job.probes.size(); ++i) {
    // Here, not where they are looked at: after a fit.
    (void)probe_points(job, i, scene);
  }
  return built;
}

}  // namespace matterfit::job
