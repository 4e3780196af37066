// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/new_job.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/mesh.hpp"
#include "capture/npz.hpp"
#include "capture/tracks.hpp"
#include "job/documents/document.hpp"
#include "job/documents/json_reader.hpp"
#include "job/documents/usual_parameters.hpp"
#include "shape/triangle_mesh.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFewestSamples = 4;  // frames, and points
constexpr double kStandardCells = 6.0;     // the preset Standard, of the thinnest part
constexpr double kFewestStandardParticles = 1e3;
constexpr double kSlackFrames = 1e-6;  // of a first sample's time, rounding
constexpr double kHeldOut = 0.25;      // share of the frames
// Where a search begins: E/ρ [m²/s²] of soft rubber, for a flight does not tell E, and a foam that
// is as stiff as rubber has waves that take many times the substeps.
constexpr double kStiffnessPerDensity = 100.0;
constexpr double kPoissonRatio = 0.3;

/// The first frame with every point in it.
Points first_frame(const capture::Tracks& tracks, const std::string& name) {
  std::size_t first = 0;
  const auto seen = [&](std::size_t frame) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < tracks.points; ++i) count += tracks.is_visible(frame, i) ? 1 : 0;
    return count;
  };
  if (seen(first) < kFewestSamples) {
    throw_input(name + ": the first frame shows " + std::to_string(seen(first)) +
                " points; at least " + std::to_string(kFewestSamples) +
                " are needed to say where the " +
                "body is. Cut the recording to begin where it is seen.");
  }
  Points rest(tracks.points, Vec3d::Zero());
  std::vector<std::uint8_t> known(tracks.points, 0);
  for (std::size_t i = 0; i < tracks.points; ++i) {
    if (!tracks.is_visible(first, i)) continue;
    rest[i] = tracks.position(first, i);
    known[i] = 1;
  }
  for (std::size_t frame = 1; frame < tracks.frames(); ++frame) {
    std::vector<std::size_t> common;
    std::vector<std::size_t> missing;
    for (std::size_t i = 0; i < tracks.points; ++i) {
      if (!tracks.is_visible(frame, i)) continue;
      (tracks.is_visible(first, i) ? common : missing).push_back(i);
    }
    std::erase_if(missing, [&](std::size_t i) { return known[i] != 0; });
    if (missing.empty() || common.size() < 3) continue;
    Eigen::Matrix3Xd from(3, static_cast<Eigen::Index>(common.size()));
    Eigen::Matrix3Xd to(3, static_cast<Eigen::Index>(common.size()));
    for (std::size_t k = 0; k < common.size(); ++k) {
      from.col(static_cast<Eigen::Index>(k)) = tracks.position(frame, common[k]);
      to.col(static_cast<Eigen::Index>(k)) = tracks.position(first, common[k]);
    }
    const Eigen::Matrix4d back = Eigen::umeyama(from, to, false);
    for (const std::size_t i : missing) {
      rest[i] = (back * tracks.position(frame, i).homogeneous()).head<3>();
      known[i] = 1;
    }
  }
  if (const auto lost = std::find(known.begin(), known.end(), 0); lost != known.end()) {
    throw_input(name + ": point " + std::to_string(lost - known.begin()) +
                " is not visible in any frame that shows three points of the first one. Leave it " +
                "out of the file.");
  }
  return rest;
}

/// The mesh that the file itself has, over the first frame; without faces: none.
std::optional<capture::Mesh> mesh_of(const fs::path& path, const Points& rest) {
  if (path.extension() != ".npz") return {};
  const capture::Arrays arrays = capture::read_npz(path);
  capture::Mesh mesh;
  const std::string name = path.filename().string();
  const auto indices = [&](const capture::Array& array, const char* what) {
    std::vector<std::int32_t> result;
    for (const std::int64_t index : array.integers(name + ": '" + what + "'")) {
      if (index < 0 || index >= static_cast<std::int64_t>(rest.size())) {
        throw_input(name + ": '" + what + "' names vertex " + std::to_string(index) + ", but '" +
                    "positions' has " + std::to_string(rest.size()) + " points.");
      }
      result.push_back(static_cast<std::int32_t>(index));
    }
    return result;
  };
  if (const auto faces = arrays.find("faces"); faces != arrays.end()) {
    const capture::Array& array = faces->second;
    if (array.shape.size() != 2 || array.shape[1] < 3) {
      throw_input(name + ": 'faces' has shape " + array.shape_text() +
                  ", expected (faces, 3) or (faces, 4) vertex indices.");
    }
    mesh.face_vertices = indices(array, "faces");
    mesh.face_sizes.assign(array.shape[0], static_cast<std::int32_t>(array.shape[1]));
  } else if (arrays.contains("face_sizes") && arrays.contains("face_vertices")) {
    mesh.face_vertices = indices(arrays.at("face_vertices"), "face_vertices");
    for (const std::int64_t size : arrays.at("face_sizes").integers(name + ": 'face_sizes'")) {
      mesh.face_sizes.push_back(
          static_cast<std::int32_t>(std::clamp<std::int64_t>(size, 0, 1 << 20)));
    }
  } else {
    return {};
  }
  mesh.vertices.reserve(rest.size());
  for (const Vec3d& x : rest) mesh.vertices.push_back(x.cast<float>());
  capture::check_mesh(mesh, name);
  return mesh;
}

/// Volume and surface of the body [m³, m²]; of points those of their box.
struct BodySize {
  double volume = 0.0;
  double area = 0.0;
};

BodySize size_of(const capture::Mesh& mesh) {
  BodySize extent;
  const auto triangles = shape::triangulate("the recording's mesh", mesh.vertices, mesh.face_sizes,
                                            mesh.face_vertices);
  for (const shape::Triangle& t : triangles) {
    const Vec3d a = mesh.vertices[static_cast<std::size_t>(t[0])].cast<double>();
    const Vec3d b = mesh.vertices[static_cast<std::size_t>(t[1])].cast<double>();
    const Vec3d c = mesh.vertices[static_cast<std::size_t>(t[2])].cast<double>();
    extent.area += 0.5 * (b - a).cross(c - a).norm();
    extent.volume += a.dot(b.cross(c)) / 6.0;
  }
  extent.volume = std::abs(extent.volume);
  return extent;
}

BodySize size_of(const Points& points) {
  Eigen::AlignedBox3d box;
  for (const Vec3d& x : points) box.extend(x);
  const Vec3d s = box.sizes();
  return {s.prod(), 2.0 * (s.x() * s.y() + s.y() * s.z() + s.z() * s.x())};
}

/// Six cells across 2 V/A, which is a plate's thickness and two thirds of a ball's radius, as far
/// as the number of particles allows; two significant digits, so that it reads well.
double separation_of(const BodySize& extent, std::size_t particles) {
  const double thickness = 2.0 * extent.volume / extent.area;
  double h = thickness / (2.0 * kStandardCells);
  h = std::max(h, std::cbrt(extent.volume / static_cast<double>(particles)));
  h = std::min(h, std::cbrt(extent.volume / kFewestStandardParticles));
  return std::stod(fmt::format("{:.2g}", h));
}

Json material_of(material::Law law, double density) {
  const material::LawTraits& traits = material::traits(law);
  const double stiffness = kStiffnessPerDensity * density;
  Json json = {{"law", traits.name}};
  const auto put = [&](const char* key, double value) {
    if (traits.uses(key)) json[key] = value;
  };
  put("E", stiffness);
  put("nu", kPoissonRatio);
  put("yield_stress", 0.02 * stiffness);
  put("viscosity", 10.0);
  put("friction_angle", 30.0);
  put("bulk_modulus", stiffness);
  return json;
}

}  // namespace

std::vector<std::string> write_new_job(const NewJobOptions& options) {
  if (const material::LawTraits& law = material::traits(options.law); law.parameters.empty()) {
    throw_input("a new job is a fit, and the law " + std::string(law.name) +
                " has no numbers that could be fitted.");
  }
  const std::string name = options.capture.filename().string();
  capture::TracksOptions reading;
  reading.unit = options.unit;
  reading.up = options.up;
  if (options.noise) reading.noise = {*options.noise};
  const capture::Tracks tracks = capture::read_tracks(options.capture, reading);
  if (tracks.frames() < kFewestSamples) {
    throw_input(name + ": has " + std::to_string(tracks.frames()) + " frames; at least " +
                std::to_string(kFewestSamples) + " are needed to see a motion.");
  }
  const Points rest = first_frame(tracks, name);
  const auto mesh = mesh_of(options.capture, rest);
  const BodySize extent = mesh ? size_of(*mesh) : size_of(rest);
  if (!(extent.volume > 0.0)) {
    throw_input(name + ": the points of the first frame enclose no volume. Give 'faces' of a " +
                "closed mesh in the file, or write the body into the document by hand.");
  }
  const fs::path folder = fs::absolute(options.output).parent_path();
  const std::string stem = options.output.stem().string();
  Json source;
  if (mesh) {
    capture::write_mesh_ply(folder / (stem + "_body.ply"), *mesh);
    source = {{"mesh", stem + "_body.ply"}};
  } else {
    capture::Arrays arrays;
    std::vector<double> numbers;
    numbers.reserve(3 * rest.size());
    for (const Vec3d& x : rest) numbers.insert(numbers.end(), {x.x(), x.y(), x.z()});
    arrays.emplace("positions", capture::Array({rest.size(), 3}, std::move(numbers)));
    capture::write_npz(folder / (stem + "_body.npz"), arrays);
    source = {{"points", stem + "_body.npz"}, {"sampling", "lattice"}};
  }

  const std::size_t frames = tracks.frames();
  const double fps = static_cast<double>(frames - 1) / (tracks.times.back() - tracks.times.front());
  const auto held = static_cast<std::size_t>(std::ceil(kHeldOut * static_cast<double>(frames)));
  const material::LawTraits& traits = material::traits(options.law);
  Json parameters = {"velocity", "spin"};
  for (const std::string_view key : kUsualNumbers) {
    if (traits.uses(key)) parameters.push_back("material." + std::string(key));
  }
  Json capture = {{"name", options.capture.stem().string()},
                  {"tracks", fs::proximate(fs::absolute(options.capture), folder).generic_string()},
                  {"body", "body"},
                  {"holdout", {{"frames", {frames - held, frames}}}}};
  std::vector<std::string> statements;
  // The body is where the first sample shows it, so the scene begins there: also by a part of a
  // frame, which would otherwise be a late clock.
  if (const double first = tracks.times.front() * fps; std::abs(first) > kSlackFrames) {
    capture["start_frame"] = -first;
    statements.push_back(fmt::format(
        "{}: the first sample is at {:.6g} s of its clock. The scene begins there, since the body "
        "is where that sample shows it: 'start_frame' of the capture is {:.6g}.",
        name, tracks.times.front(), -first));
  }
  if (options.noise) capture["noise"] = *options.noise;
  if (options.unit > 0.0) capture["unit"] = options.unit;
  if (options.up != 0) capture["up"] = std::string(1, options.up);
  Json places = Json::array();
  bool hidden = false;
  for (std::size_t i = 0; i < tracks.points; ++i) {
    hidden = hidden || !tracks.is_visible(0, i);
    places.push_back({rest[i].x(), rest[i].y(), rest[i].z()});
  }
  if (hidden) capture["positions"] = places;
  Json scene = {{"fps", fps},
                {"frames", {0, frames}},
                {"gravity", {0.0, 0.0, -options.gravity.value_or(9.81)}},
                {"particle_separation", separation_of(extent, options.particles)},
                {"bodies",
                 {{{"name", "body"},
                   {"source", source},
                   {"density", options.density},
                   {"material", material_of(options.law, options.density)}}}}};
  if (options.ground) {
    scene["colliders"] = {{{"name", "ground"},
                           {"shape", "ground"},
                           {"height", *options.ground},
                           {"contact", {{"kind", "friction"}, {"mu", options.friction}}}}};
  }
  const Json document = {{"schema", kSchema},
                         {"task", "fit"},
                         {"scene", scene},
                         {"captures", {capture}},
                         {"fit", {{"parameters", parameters}}},
                         {"output", {{"folder", stem + "_out"}}}};
  const std::string text = document.dump(2) + "\n";
  // What is written must be what the reader takes: an error is told now, not by the next command.
  ReadOptions check;
  check.base_folder = folder;
  (void)read_job(text, check);
  write_file(options.output, text);
  return statements;
}

}  // namespace matterfit::job
