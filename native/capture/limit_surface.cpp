// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/limit_surface.hpp"

#include <fmt/format.h>
#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <opensubdiv/far/topologyRefinerFactory.h>

#include <cmath>
#include <memory>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

namespace Far = OpenSubdiv::Far;

/// A position as OpenSubdiv's refiner sums it.
struct Position {
  Vec3d x = Vec3d::Zero();
  void Clear() { x.setZero(); }
  void AddWithWeight(const Position& other, double weight) { x += weight * other.x; }
};

void check_cage(const Mesh& cage, const LimitOptions& options) {
  const auto vertices = static_cast<std::int32_t>(cage.vertices.size());
  if (options.level < 1 || options.level > 10) {
    throw_input(fmt::format("Cage: subdivision level {} is outside 1 to 10.", options.level));
  }
  std::size_t corners = 0;
  for (std::size_t f = 0; f < cage.face_sizes.size(); ++f) {
    if (cage.face_sizes[f] < 3 || cage.face_sizes[f] > 4096) {
      throw_input(
          fmt::format("Cage: face {} has {} corners, expected 3 to 4096.", f, cage.face_sizes[f]));
    }
    corners += static_cast<std::size_t>(cage.face_sizes[f]);
  }
  if (corners == 0 || corners != cage.face_vertices.size()) {
    throw_input(fmt::format("Cage: its {} faces use {} corners, but {} are listed.",
                            cage.face_sizes.size(), corners, cage.face_vertices.size()));
  }
  for (const std::int32_t v : cage.face_vertices) {
    if (v < 0 || v >= vertices) {
      throw_input(fmt::format("Cage: a face names vertex {}, but there are {}.", v, vertices));
    }
  }
  for (std::size_t i = 0; i < cage.vertices.size(); ++i) {
    if (!cage.vertices[i].allFinite())
      throw_input(fmt::format("Cage: vertex {} is not finite.", i));
  }
  if (cage.crease_edges.size() != 2 * cage.crease_sharpness.size()) {
    throw_input(fmt::format("Cage: {} crease vertices for {} sharpnesses, expected two for each.",
                            cage.crease_edges.size(), cage.crease_sharpness.size()));
  }
  for (const std::int32_t v : cage.crease_edges) {
    if (v < 0 || v >= vertices) {
      throw_input(fmt::format("Cage: a crease names vertex {}, but there are {}.", v, vertices));
    }
  }
  const double faces = static_cast<double>(corners) * std::pow(4.0, options.level - 1);
  if (faces > 16e6) {
    throw_input(fmt::format("Cage: level {} makes {:.3g} faces, more than 16 million.",
                            options.level, faces));
  }
}

}  // namespace

Mesh limit_mesh(const Mesh& cage, const LimitOptions& options) {
  check_cage(cage, options);
  Far::TopologyDescriptor descriptor;
  descriptor.numVertices = static_cast<int>(cage.vertices.size());
  descriptor.numFaces = static_cast<int>(cage.face_sizes.size());
  descriptor.numVertsPerFace = cage.face_sizes.data();
  descriptor.vertIndicesPerFace = cage.face_vertices.data();
  descriptor.numCreases = static_cast<int>(cage.crease_sharpness.size());
  descriptor.creaseVertexIndexPairs = cage.crease_edges.data();
  descriptor.creaseWeights = cage.crease_sharpness.data();

  OpenSubdiv::Sdc::Options scheme;
  scheme.SetVtxBoundaryInterpolation(options.keep_corners
                                         ? OpenSubdiv::Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER
                                         : OpenSubdiv::Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
  using Factory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
  const std::unique_ptr<Far::TopologyRefiner> refiner(
      Factory::Create(descriptor, Factory::Options(OpenSubdiv::Sdc::SCHEME_CATMARK, scheme)));
  if (!refiner) {
    throw_input(
        "Cage: OpenSubdiv cannot make a surface of its faces. Does a face use an edge twice?");
  }
  Far::TopologyRefiner::UniformOptions uniform(options.level);
  uniform.fullTopologyInLastLevel = true;  // limit masks need it
  refiner->RefineUniform(uniform);

  const Far::PrimvarRefinerReal<double> primvars(*refiner);
  std::vector<Position> now(cage.vertices.size());
  for (std::size_t i = 0; i < now.size(); ++i) now[i].x = cage.vertices[i].cast<double>();
  for (int level = 1; level <= options.level; ++level) {
    std::vector<Position> next(static_cast<std::size_t>(refiner->GetLevel(level).GetNumVertices()));
    primvars.Interpolate(level, now, next);
    now = std::move(next);
  }
  std::vector<Position> limit(now.size());
  primvars.Limit(now, limit);

  Mesh out;
  const Far::TopologyLevel& last = refiner->GetLevel(options.level);
  out.vertices.reserve(limit.size());
  for (const Position& p : limit) out.vertices.push_back(p.x.cast<float>());
  for (int f = 0; f < last.GetNumFaces(); ++f) {
    const Far::ConstIndexArray corners = last.GetFaceVertices(f);
    out.face_sizes.push_back(corners.size());
    for (int i = 0; i < corners.size(); ++i) out.face_vertices.push_back(corners[i]);
  }
  return out;
}

}  // namespace matterfit::capture
