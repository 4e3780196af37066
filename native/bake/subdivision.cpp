// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/subdivision.hpp"

#include <opensubdiv/far/ptexIndices.h>
#include <opensubdiv/far/stencilTableFactory.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <opensubdiv/far/topologyRefinerFactory.h>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <array>
#include <cstdint>
#include <string>

#include "base/error.hpp"

namespace matterfit::bake {
namespace {

namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

using SparseMatrix = Eigen::SparseMatrix<double>;
using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3>;

constexpr double kEpsilon = 0.03;
constexpr int kIterations = 2;

void check_cage(const capture::Mesh& cage) {
  const auto vertices = static_cast<std::int64_t>(cage.vertices.size());
  std::int64_t corners = 0;
  for (std::size_t f = 0; f < cage.face_sizes.size(); ++f) {
    if (cage.face_sizes[f] < 3 || cage.face_sizes[f] > 4096) {
      throw_input("cage: face " + std::to_string(f) + " has " + std::to_string(cage.face_sizes[f]) +
                  " corners, expected 3 to 4096.");
    }
    corners += cage.face_sizes[f];
  }
  if (corners != static_cast<std::int64_t>(cage.face_vertices.size())) {
    throw_input("cage: its faces use " + std::to_string(corners) + " corners, but " +
                std::to_string(cage.face_vertices.size()) + " are listed.");
  }
  const auto check_index = [&](std::int32_t v, const char* what) {
    if (v < 0 || v >= vertices) {
      throw_input(std::string("cage: a ") + what + " names vertex " + std::to_string(v) +
                  ", but there are " + std::to_string(vertices) + ".");
    }
  };
  for (const std::int32_t v : cage.face_vertices) check_index(v, "face");
  for (const std::int32_t v : cage.crease_edges) check_index(v, "crease");
  if (cage.crease_edges.size() != 2 * cage.crease_sharpness.size()) {
    throw_input("cage: " + std::to_string(cage.crease_edges.size()) + " crease vertices for " +
                std::to_string(cage.crease_sharpness.size()) + " sharpnesses, expected two each.");
  }
}

std::unique_ptr<Far::TopologyRefiner> make_refiner(const capture::Mesh& cage, bool keep_corners) {
  Far::TopologyDescriptor descriptor;
  descriptor.numVertices = static_cast<int>(cage.vertices.size());
  descriptor.numFaces = static_cast<int>(cage.face_sizes.size());
  descriptor.numVertsPerFace = cage.face_sizes.data();
  descriptor.vertIndicesPerFace = cage.face_vertices.data();
  descriptor.numCreases = static_cast<int>(cage.crease_sharpness.size());
  descriptor.creaseVertexIndexPairs = cage.crease_edges.data();
  descriptor.creaseWeights = cage.crease_sharpness.data();
  Sdc::Options sdc;
  sdc.SetVtxBoundaryInterpolation(keep_corners ? Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER
                                               : Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
  using Factory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
  std::unique_ptr<Far::TopologyRefiner> refiner(
      Factory::Create(descriptor, Factory::Options(Sdc::SCHEME_CATMARK, sdc)));
  if (!refiner) throw_input("cage: OpenSubdiv cannot take its faces (an edge or vertex repeated).");
  return refiner;
}

/// Row v: the limit point of vertex v as a combination of the cage's vertices.
SparseMatrix limit_matrix(const capture::Mesh& cage, bool keep_corners) {
  const auto count = static_cast<Eigen::Index>(cage.vertices.size());
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<Eigen::Index> order;  // vertex of each stencil
  std::vector<std::uint8_t> used(cage.vertices.size(), 0);
  if (!cage.face_sizes.empty()) {
    const auto refiner = make_refiner(cage, keep_corners);
    const Far::PtexIndices ptex(*refiner);
    refiner->RefineAdaptive(Far::TopologyRefiner::AdaptiveOptions(6));
    // Corner k of a quad in its own parameters; other polygons have one sub-quad a corner, whose
    // origin is that corner.
    static constexpr std::array<double, 4> kS{0.0, 1.0, 1.0, 0.0};
    static constexpr std::array<double, 4> kT{0.0, 0.0, 1.0, 1.0};
    using Factory = Far::LimitStencilTableFactoryReal<double>;
    Factory::LocationArrayVec locations;
    std::size_t corner = 0;
    for (std::size_t f = 0; f < cage.face_sizes.size(); ++f) {
      const int size = cage.face_sizes[f];
      for (int k = 0; k < size; ++k, ++corner) {
        const auto v = static_cast<std::size_t>(cage.face_vertices[corner]);
        if (used[v] != 0) continue;
        used[v] = 1;
        const int base = ptex.GetFaceId(static_cast<int>(f));
        Factory::LocationArray location;
        location.ptexIdx = size == 4 ? base : base + k;
        location.numLocations = 1;
        location.s = size == 4 ? &kS[static_cast<std::size_t>(k)] : &kS[0];
        location.t = size == 4 ? &kT[static_cast<std::size_t>(k)] : &kT[0];
        locations.push_back(location);
        order.push_back(static_cast<Eigen::Index>(v));
      }
    }
    Factory::Options options;
    options.generate1stDerivatives = false;
    const std::unique_ptr<const Far::LimitStencilTableReal<double>> table(
        Factory::Create(*refiner, locations, nullptr, nullptr, options));
    if (!table || table->GetNumStencils() != static_cast<int>(order.size())) {
      throw_input("cage: OpenSubdiv found no limit surface for some of its vertices.");
    }
    for (std::size_t i = 0; i < order.size(); ++i) {
      const auto stencil = table->GetLimitStencil(static_cast<int>(i));
      for (int k = 0; k < stencil.GetSize(); ++k) {
        entries.emplace_back(order[i], stencil.GetVertexIndices()[k], stencil.GetWeights()[k]);
      }
    }
  }
  for (std::size_t v = 0; v < used.size(); ++v) {
    // Loose vertices are where they are.
    if (used[v] == 0) {
      entries.emplace_back(static_cast<Eigen::Index>(v), static_cast<Eigen::Index>(v), 1.0);
    }
  }
  SparseMatrix matrix(count, count);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

Columns columns_of(std::span<const Vec3d> points) {
  Columns result(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) {
    result.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
  }
  return result;
}

std::vector<Vec3d> points_of(const Columns& columns) {
  std::vector<Vec3d> result(static_cast<std::size_t>(columns.rows()));
  for (std::size_t i = 0; i < result.size(); ++i) {
    result[i] = columns.row(static_cast<Eigen::Index>(i)).transpose();
  }
  return result;
}

std::vector<Vec3d> as_double(std::span<const Vec3f> points) {
  std::vector<Vec3d> result;
  result.reserve(points.size());
  for (const Vec3f& p : points) result.push_back(p.cast<double>());
  return result;
}

}  // namespace

struct CageBinding::Impl {
  SparseMatrix limit;
  Eigen::SimplicialLDLT<SparseMatrix> solver;  ///< of LᵀL + ε² I
  capture::MeshBinding cage;
  capture::MeshBinding surface;

  Impl(SparseMatrix limit_in, std::span<const Vec3d> cage_points, std::span<const Vec3d> rest,
       double separation, const capture::BindingOptions& options, Arena& arena)
      : limit(std::move(limit_in)),
        cage(cage_points, rest, separation, options, arena),
        surface(points_of(limit * columns_of(cage_points)), rest, separation, options, arena) {
    SparseMatrix normal = limit.transpose() * limit;
    SparseMatrix identity(normal.rows(), normal.cols());
    identity.setIdentity();
    normal += kEpsilon * kEpsilon * identity;
    solver.compute(normal);
    if (solver.info() != Eigen::Success) {
      throw_compute(
          "cage: the limit surface could not be inverted. Remove the subdivision "
          "modifier's creases or bind the mesh without it.");
    }
  }
};

CageBinding::CageBinding(const capture::Mesh& cage, std::span<const Vec3d> rest, double separation,
                         const CageOptions& options, Arena& arena) {
  check_cage(cage);
  impl_ = std::make_unique<Impl>(limit_matrix(cage, options.keep_corners), as_double(cage.vertices),
                                 rest, separation, options.binding, arena);
}
CageBinding::~CageBinding() = default;
CageBinding::CageBinding(CageBinding&&) noexcept = default;
CageBinding& CageBinding::operator=(CageBinding&&) noexcept = default;

std::vector<Vec3d> CageBinding::cage_positions(const capture::ParticleView& state,
                                               Arena& arena) const {
  const Columns target = columns_of(impl_->surface.positions(state, arena));
  Columns cage = columns_of(impl_->cage.positions(state, arena));
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Columns residual = impl_->limit.transpose() * (target - impl_->limit * cage);
    cage += impl_->solver.solve(residual);
  }
  return points_of(cage);
}

std::vector<Vec3d> CageBinding::limit_positions(std::span<const Vec3d> cage_positions) const {
  return points_of(impl_->limit * columns_of(cage_positions));
}

capture::MeshBinding::Farthest CageBinding::farthest() const { return impl_->surface.farthest(); }

}  // namespace matterfit::bake
