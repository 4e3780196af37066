// SPDX-License-Identifier: GPL-3.0-or-later
#include "shape/distance_grid.hpp"

#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/error.hpp"

namespace matterfit::shape {
namespace {

constexpr double kHalfDiagonal = 0.8660254037844387;  // √3/2, of a voxel

/// The shell's triangles in index space, in the types for which OpenVDB's library brings its mesh
/// conversion: with others it is compiled anew, for more than a minute.
struct ShellMesh {
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  double rounding = 0.0;  ///< how far off a point may be [voxels]

  ShellMesh(const MeshDistance& mesh, std::size_t shell, const std::vector<Vec3f>& vertices,
            double voxel) {
    constexpr double kUnit = 1.2e-7;  // of float
    for (const std::int32_t n : mesh.tree(shell).members()) {
      const auto corner = static_cast<openvdb::Index32>(points.size());
      triangles.emplace_back(corner, corner + 1, corner + 2);
      for (const std::int32_t v : mesh.topology().triangles[static_cast<std::size_t>(n)]) {
        const Vec3d p = vertices[static_cast<std::size_t>(v)].cast<double>() / voxel;
        points.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()),
                            static_cast<float>(p.z()));
        rounding = std::max(rounding, kUnit * p.cwiseAbs().maxCoeff());
      }
    }
  }

  /// Voxels within the band, from area and box: an upper estimate, before anything is allocated.
  [[nodiscard]] double estimate_voxels(double band_voxels) const {
    double area = 0;
    Eigen::AlignedBox3d box;
    for (const openvdb::Vec3I& t : triangles) {
      openvdb::Vec3d p[3];
      for (int v = 0; v < 3; ++v) {
        p[v] = points[t[v]];
        box.extend(Vec3d(p[v].x(), p[v].y(), p[v].z()));
      }
      area += 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).length();
    }
    const Vec3d sides = box.sizes().array() + 2 * band_voxels + 2;
    if (box.min().cwiseAbs().maxCoeff() > 1e9 || box.max().cwiseAbs().maxCoeff() > 1e9) {
      return std::numeric_limits<double>::infinity();
    }
    return std::min(sides.prod(), (area + sides.sum()) * (2 * band_voxels + 2));
  }
};

/// What OpenVDB asks whether it should go on; of its own type, so that its functions come compiled
/// from its library: they take minutes.
class Watch : public openvdb::util::NullInterrupter {
 public:
  explicit Watch(const Interrupter* interrupter) : interrupter_(interrupter) {}
  bool wasInterrupted(int /*percent*/ = -1) override {
    return interrupter_ != nullptr && interrupter_->cancelled();
  }
  void check() const {
    if (interrupter_ != nullptr) interrupter_->check();
  }

 private:
  const Interrupter* interrupter_;
};

}  // namespace

struct DistanceGrid::Impl {
  openvdb::FloatGrid::Ptr grid;
  double voxel;
  double background;
  bool sheet;
};

DistanceGrid::DistanceGrid(const MeshDistance& mesh, std::size_t shell, std::size_t frame,
                           const Options& options)
    : impl_(std::make_unique<Impl>()) {
  openvdb::initialize();
  const double voxel = options.voxel_size;
  const ShellMesh surface(mesh, shell, mesh.frames()[frame], voxel);
  const double band_voxels = options.band / voxel + kHalfDiagonal + 1e-3 + surface.rounding;
  constexpr double kMostVoxels = 4e8;
  if (const double voxels = surface.estimate_voxels(band_voxels); voxels > kMostVoxels) {
    const double factor = std::isfinite(voxels) ? std::sqrt(voxels / kMostVoxels) : 1e6;
    throw_input(options.what + ": a distance grid of voxel " + std::to_string(voxel) +
                " m would have about " + std::to_string(voxels) +
                " voxels near the surface; make voxel_size at least " +
                std::to_string(voxel * std::ceil(factor * 10) / 10) +
                " m, or check the mesh's unit and scale.");
  }
  const auto transform = openvdb::math::Transform::createLinearTransform(voxel);
  impl_->voxel = voxel;
  impl_->background = band_voxels * voxel;
  impl_->sheet = mesh.kind(shell) == MeshDistance::Kind::kSheet;
  // One thread: the conversion breaks ties between equally near polygons by order of arrival; and a
  // lazily built grid must not steal the caller's tasks while others wait for it.
  tbb::task_arena alone(1);
  alone.execute([&] {
    const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I> adapter(
        surface.points, surface.triangles);
    Watch watch(options.interrupter);
    impl_->grid = openvdb::tools::meshToVolume<openvdb::FloatGrid>(
        watch.interrupter(), adapter, *transform, static_cast<float>(band_voxels),
        static_cast<float>(band_voxels), openvdb::tools::UNSIGNED_DISTANCE_FIELD);
    const auto background = static_cast<float>(impl_->background);
    watch.check();
    for (auto leaf = impl_->grid->tree().beginLeaf(); leaf; ++leaf) {
      watch.check();
      for (auto value = leaf->beginValueAll(); value; ++value) {
        if (!value.isValueOn()) {
          value.setValue(background);
          continue;
        }
        const openvdb::Coord ijk = value.getCoord();
        const Vec3d x = voxel * Vec3d(ijk.x(), ijk.y(), ijk.z());
        const double reach =
            static_cast<double>(value.getValue()) * 1.001 + (0.01 + 2.0 * surface.rounding) * voxel;
        double distance = impl_->background;
        if (impl_->sheet) {
          NearestTriangle nearest;
          nearest.distance2 = reach * reach;
          mesh.tree(shell).closest(x, frame, 0.0, nearest);
          if (nearest.triangle >= 0) distance = std::sqrt(nearest.distance2);
        } else if (const auto hit = mesh.at_shell(shell, x, frame, 0.0, reach); hit.triangle >= 0) {
          distance = hit.distance;
        }
        value.setValue(static_cast<float>(distance));
      }
    }
    if (!impl_->sheet) {
      openvdb::tools::signedFloodFillWithValues(impl_->grid->tree(), background, -background,
                                                false);
    }
  });
}

DistanceGrid::~DistanceGrid() = default;

DistanceGrid::Bounds DistanceGrid::bounds(const Vec3d& x) const {
  const Vec3d index = x / impl_->voxel;
  if (!(index.cwiseAbs().maxCoeff() < 2e9)) {
    return {impl_->background, std::numeric_limits<double>::infinity(), 1.0};
  }
  const openvdb::Coord ijk(static_cast<int>(std::lround(index.x())),
                           static_cast<int>(std::lround(index.y())),
                           static_cast<int>(std::lround(index.z())));
  float value = 0.0F;
  const bool near = impl_->grid->tree().probeValue(ijk, value);
  const double off = (index - Vec3d(ijk.x(), ijk.y(), ijk.z())).norm() * impl_->voxel;
  const double distance = near ? std::abs(static_cast<double>(value)) : impl_->background;
  Bounds out;
  out.low = std::max(0.0, distance * (1.0 - 1e-6) - off);
  out.high = near ? distance * (1.0 + 1e-6) + off + 1e-6 * impl_->voxel
                  : std::numeric_limits<double>::infinity();
  out.sign = value < 0.0F ? -1.0 : 1.0;
  return out;
}

std::size_t DistanceGrid::bytes() const { return impl_->grid->memUsage(); }

}  // namespace matterfit::shape
