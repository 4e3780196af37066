// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.hpp"
#include "capture/fill.hpp"
#include "capture/mesh.hpp"
#include "capture/splats.hpp"
#include "job/documents/document_error.hpp"
#include "job/run/build_scene.hpp"
#include "mpm/scene_check.hpp"

namespace matterfit::job {
namespace {

capture::Mesh scaled(capture::Mesh mesh, double scale) {
  for (Vec3f& x : mesh.vertices) x *= static_cast<float>(scale);
  return mesh;
}

/// Everything a source needs from disk, scaled, so that a second fill reads nothing again.
struct FilledShape {
  const Source& source;
  double scale;
  bool hull;  ///< of points: their hull is filled, else they are the particles
  capture::Mesh mesh;
  Points points;
  capture::GaussianArrays gaussians;

  FilledShape(const Source& source_in, double scale_in, bool hull_in)
      : source(source_in), scale(scale_in), hull(hull_in) {
    switch (source.kind) {
      case Source::Kind::kMesh:
      case Source::Kind::kCage:
        mesh = scaled(capture::read_mesh(source.file), scale);
        break;
      case Source::Kind::kPoints:
        points = read_points(source.file);
        for (Vec3d& x : points) x *= scale;
        break;
      case Source::Kind::kGaussians: {
        capture::Splats splats = capture::read_splats(source.file);
        if (source.crop) splats = capture::cropped(splats, *source.crop);
        for (std::size_t i = 0; i < splats.size(); ++i) {
          gaussians.centres.push_back(scale * splats.means[i].cast<double>());
          gaussians.scales.push_back(scale * splats.scales[i].cast<double>());
          gaussians.rotations.push_back(splats.rotations[i].cast<double>());
          gaussians.opacities.push_back(splats.opacities[i]);
        }
        break;
      }
      default:
        break;
    }
  }

  /// Throws where vertices lie where single precision has no millimetres left.
  void check_places(const std::string& path) const {
    constexpr float kFarthest = 1e6F;  // m, as a document's own places
    float farthest = 0.0F;
    for (const Vec3f& x : mesh.vertices) farthest = std::max(farthest, x.cwiseAbs().maxCoeff());
    if (farthest <= kFarthest) return;
    throw DocumentError(
        ErrorKind::kInput, path,
        ".source: its shape lies up to " + fmt::format("{:.2g}", farthest) +
            " m from its origin, and nothing can be simulated beyond 1000 km. Move its vertices "
            "to the origin, or look at its unit.");
  }

  [[nodiscard]] capture::FilledBody fill(const capture::FillOptions& options) const {
    switch (source.kind) {
      case Source::Kind::kPoints:
        return hull ? capture::fill_hull(points, options) : capture::fill_points(points, options);
      case Source::Kind::kMesh:
        return capture::fill_mesh(mesh, options);
      case Source::Kind::kCage:
        return capture::fill_cage(mesh, options, source.level);
      case Source::Kind::kGaussians: {
        capture::GaussianFillOptions gaussian;
        gaussian.opacity_threshold = source.opacity_threshold;
        gaussian.fill_inside = source.fill_inside;
        return capture::fill_gaussians(gaussians, options, gaussian);
      }
      case Source::Kind::kBox:
        return capture::fill_box(scale * source.low, scale * source.high, options);
      case Source::Kind::kSphere:
        return capture::fill_sphere(scale * source.center, scale * source.radius, options);
      case Source::Kind::kCylinder:
        return capture::fill_cylinder(scale * source.center, scale * source.radius,
                                      scale * source.height, source.axis, options);
    }
    throw_input("a source of an unknown kind.");
  }
};

/// Where the lattice must move so that the planes of plane pins are faces of its cells: a point of
/// the lattice's own axes, or nothing if they are already.
std::optional<Vec3d> pinned_anchor(const BodyDoc& doc, const mpm::Lattice& lattice) {
  constexpr double kParallel = 1e-6;
  constexpr double kOnFace = 1e-6;
  if (!lattice.regular || !(lattice.spacing > 0.0)) return std::nullopt;
  Vec3d origin = lattice.origin;
  bool moved = false;
  for (const PinDoc& pin : doc.pins) {
    if (pin.region.shape != Region::Shape::kPlane) continue;
    const Quatd back = doc.placement.rotation.conjugate();
    const Vec3d normal = back * pin.region.normal;
    const Vec3d point = back * (pin.region.point - doc.placement.position);
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3d direction = lattice.axes * Vec3d::Unit(axis);
      if (std::abs(std::abs(direction.dot(normal)) - 1.0) > kParallel) continue;
      const double offset = direction.dot(point - origin);
      const double cells = offset / lattice.spacing;
      if (std::abs(cells - std::round(cells)) < kOnFace) continue;
      origin += offset * direction;
      moved = true;
    }
  }
  return moved ? std::optional<Vec3d>(origin) : std::nullopt;
}

}  // namespace

mpm::Body build_body(const BodyDoc& doc, const SceneDoc& scene, const std::string& path,
                     std::string& report, Arena& arena, const Interrupter& interrupter) {
  mpm::Body body;
  body.name = doc.name;
  body.material = doc.material;
  body.density = doc.density;
  body.formulation = doc.formulation;
  body.velocity = doc.velocity;
  body.spin = doc.spin;

  capture::FillOptions options;
  options.separation = scene.particle_separation;
  options.seed = doc.seed;
  options.interrupter = &interrupter;
  options.axes = doc.source.rotation;
  options.jitter =
      doc.source.sampling == Source::Sampling::kJitter ||
      (doc.source.sampling == Source::Sampling::kAuto && material::traits(doc.material.law).flows);
  if (doc.source.anchor) options.anchor = doc.placement.scale * *doc.source.anchor;
  const bool hull = doc.source.sampling == Source::Sampling::kLattice ||
                    (doc.source.sampling == Source::Sampling::kAuto && mpm::is_total(body));
  const FilledShape shape(doc.source, doc.placement.scale, hull);
  shape.check_places(path);
  interrupter.check();
  capture::FilledBody filled;
  arena.execute([&] {
    filled = shape.fill(options);
    if (options.anchor) return;
    if (const auto anchor = pinned_anchor(doc, filled.lattice)) {
      options.anchor = anchor;
      filled = shape.fill(options);
    }
  });
  capture::place(filled, doc.placement.position, doc.placement.rotation);
  report = filled.report;
  capture::take_filled(body, std::move(filled));

  for (std::size_t i = 0; i < doc.pins.size(); ++i) {
    const PinDoc& pin_doc = doc.pins[i];
    mpm::Pin pin = pin_region(pin_doc.region);
    pin.motion = pin_doc.motion.in_seconds(scene.first_frame, scene.fps);
    pin.pivot = pin_doc.pivot;
    if (pin_doc.release) pin.release = scene.seconds(*pin_doc.release);
    body.pins.push_back(std::move(pin));
  }
  for (const MassDoc& mass_doc : doc.masses) {
    mpm::AttachedMass mass;
    mass.position = mass_doc.position;
    mass.mass = mass_doc.mass;
    if (mass_doc.attach) mass.attach = scene.seconds(*mass_doc.attach);
    body.masses.push_back(mass);
  }
  if (body.rest.empty())
    throw DocumentError(ErrorKind::kInput, path, ".source: nothing was filled.");
  return body;
}

}  // namespace matterfit::job
