// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.hpp"
#include "capture/fill_lattice.hpp"
#include "capture/point_tree.hpp"
#include "shape/triangle_mesh.hpp"

namespace matterfit::capture {
namespace {

using openvdb::FloatGrid;

/// OpenVDB's mesh conversions break ties by order of arrival: alone, they always give the same.
template <class Work>
void on_one_thread(const Work& work) {
  tbb::task_arena alone(1);
  alone.execute(work);
}

/// Surface of `grid` at `level` (below it is inside), without cavities where `outer_only`.
Mesh surface_of(const FloatGrid& grid, double level, bool outer_only) {
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec4I> quads;
  on_one_thread([&] { openvdb::tools::volumeToMesh(grid, points, quads, level); });
  Mesh mesh;
  mesh.vertices.reserve(points.size());
  for (const openvdb::Vec3s& p : points) mesh.vertices.emplace_back(p.x(), p.y(), p.z());
  if (quads.empty()) return mesh;
  std::vector<shape::Triangle> triangles;
  for (const openvdb::Vec4I& q : quads) {
    const auto v = [&](int i) { return static_cast<std::int32_t>(q[i]); };
    triangles.push_back({v(0), v(1), v(2)});
    triangles.push_back({v(0), v(2), v(3)});
  }
  const std::vector<std::vector<Vec3f>> frames{mesh.vertices};
  const shape::MeshTopology topology = shape::analyse_topology(std::move(triangles), frames);
  const std::vector<double> volumes = shape::shell_volumes(topology, mesh.vertices);
  // All shells are turned alike, so the largest tells which sign is an outer one.
  const double largest = *std::max_element(
      volumes.begin(), volumes.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
  for (std::size_t t = 0; t < topology.triangles.size(); ++t) {
    const double volume = volumes[static_cast<std::size_t>(topology.shells[t])];
    if (outer_only && volume * largest < 0) continue;
    shape::Triangle c = topology.triangles[t];
    if (largest < 0) std::swap(c[0], c[1]);
    mesh.face_sizes.push_back(3);
    mesh.face_vertices.insert(mesh.face_vertices.end(), c.begin(), c.end());
  }
  return mesh;
}

/// `mesh` moved along its distance by `offset` [m] (negative: inward).
Mesh offset_surface(const Mesh& mesh, double offset, double voxel, bool outer_only) {
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  for (const Vec3f& p : mesh.vertices) points.emplace_back(p.x(), p.y(), p.z());
  for (std::size_t i = 0; i + 2 < mesh.face_vertices.size(); i += 3) {
    triangles.emplace_back(static_cast<unsigned>(mesh.face_vertices[i]),
                           static_cast<unsigned>(mesh.face_vertices[i + 1]),
                           static_cast<unsigned>(mesh.face_vertices[i + 2]));
  }
  FloatGrid::Ptr grid;
  on_one_thread([&] {
    grid = openvdb::tools::meshToLevelSet<FloatGrid>(
        *openvdb::math::Transform::createLinearTransform(voxel), points, triangles,
        static_cast<float>(std::abs(offset) / voxel + 3.0));
  });
  return surface_of(*grid, offset, outer_only);
}

double enclosed_volume(const Mesh& mesh) {
  double sum = 0;
  for (std::size_t i = 0; i + 2 < mesh.face_vertices.size(); i += 3) {
    const auto p = [&](std::size_t k) {
      return Vec3d(
          mesh.vertices[static_cast<std::size_t>(mesh.face_vertices[i + k])].cast<double>());
    };
    sum += p(0).dot(p(1).cross(p(2))) / 6.0;
  }
  return sum;
}

/// Mean distance of each point to its three nearest neighbours, then averaged with those of eight
/// neighbours: even the corner of a lattice has three neighbours at its spacing.
std::vector<double> local_spacing(const Points& points) {
  const PointCloud cloud{points};
  PointTree<> tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  tree.buildIndex();
  constexpr std::size_t kAround = 9;  // itself and eight others
  std::vector<std::size_t> neighbours(kAround * points.size());
  std::vector<double> nearest(points.size(), 0.0);
  const std::size_t around = std::min(kAround, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    double squares[kAround];
    std::size_t found[kAround];
    tree.knnSearch(points[i].data(), around, found, squares);
    std::copy(found, found + around, neighbours.begin() + static_cast<std::ptrdiff_t>(kAround * i));
    const std::size_t used = std::min<std::size_t>(3, around - 1);
    for (std::size_t n = 1; n <= used; ++n) {
      nearest[i] += std::sqrt(squares[n]) / static_cast<double>(used);
    }
  }
  std::vector<double> spacing(points.size(), 0.0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t n = 0; n < around; ++n) {
      spacing[i] += nearest[neighbours[kAround * i + n]] / static_cast<double>(around);
    }
  }
  return spacing;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Do all points sit on one lattice of `spacing` along `axes`? Then its origin.
bool on_lattice(const Points& points, double spacing, const Quatd& axes, Vec3d& origin) {
  const Vec3d first = axes.conjugate() * points[0];
  for (const Vec3d& x : points) {
    const Vec3d steps = (axes.conjugate() * x - first) / spacing;
    const Vec3d off = steps - Vec3d(steps.array().round());
    if (off.cwiseAbs().maxCoeff() > 1e-3) return false;
  }
  origin = axes * Vec3d(first - Vec3d::Constant(0.5 * spacing));
  return true;
}

/// Distance to the union of balls of one radius about `points`, `band` voxels wide outside.
/// (OpenVDB's own rasteriser of particles compiles three kinds of trees for it, most of a minute.)
FloatGrid::Ptr union_of_balls(const Points& points, double radius, double voxel, double band) {
  FloatGrid::Ptr grid = openvdb::createLevelSet<FloatGrid>(voxel, band);
  FloatGrid::Accessor distances = grid->getAccessor();
  const double reach = radius / voxel + band;
  for (const Vec3d& x : points) {
    const openvdb::Vec3d centre(x.x() / voxel, x.y() / voxel, x.z() / voxel);
    const openvdb::CoordBBox around(openvdb::Coord::ceil(centre - openvdb::Vec3d(reach)),
                                    openvdb::Coord::floor(centre + openvdb::Vec3d(reach)));
    for (const openvdb::Coord& at : around) {
      const auto distance = float((at.asVec3d() - centre).length() * voxel - radius);
      if (distance < distances.getValue(at)) distances.setValue(at, distance);
    }
  }
  return grid;
}

/// Surface of a body, and what it encloses [m³].
struct Hull {
  Mesh mesh;
  double volume = 0.0;
};

/// The hull of the body whose particles are `points` about `spacing` apart.
Hull closed_hull(const Points& points, double spacing) {
  const double voxel = 0.25 * spacing;
  const double radius = 1.5 * spacing;
  const Mesh grown = surface_of(*union_of_balls(points, radius, voxel, 3.0), 0.0, false);
  Hull hull{offset_surface(grown, 0.5 * spacing - radius, voxel, false)};
  hull.volume = enclosed_volume(hull.mesh);
  if (!(hull.volume > 0)) {
    throw_input("Points to fill: they enclose no volume; give the body's volume.");
  }
  return hull;
}

void check_points(const Points& points, const FillOptions& options) {
  if (points.size() < 2 || points.size() > options.limit) {
    throw_input(
        fmt::format("Points to fill: {} points, expected 2 to {}.", points.size(), options.limit));
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite())
      throw_input(fmt::format("Points to fill: point {} is not finite.", i));
  }
}

/// How far apart points are.
struct Spacing {
  std::vector<double> local;  ///< about each point [m]
  double typical = 0.0;       ///< their median [m]
  mpm::Lattice lattice;
};

Spacing spacing_of(const Points& points, const FillOptions& options) {
  Spacing spacing;
  spacing.local = local_spacing(points);
  spacing.typical = median(spacing.local);
  if (!(spacing.typical > 0)) {
    throw_input("Points to fill: most points coincide; remove duplicates.");
  }
  double deviation = 0;
  for (const double s : spacing.local) {
    deviation = std::max(deviation, std::abs(s - spacing.typical));
  }
  mpm::Lattice& lattice = spacing.lattice;
  lattice.axes = options.axes.normalized();
  lattice.origin = points[0];
  lattice.regular = deviation < 0.01 * spacing.typical &&
                    on_lattice(points, spacing.typical, lattice.axes, lattice.origin);
  // Three nearest neighbours of random points lie on average .72 n^(−1/3) away.
  lattice.spacing = lattice.regular ? spacing.typical : spacing.typical / 0.72;
  return spacing;
}

/// The points as particles; see fill_points.
FilledBody particles_at(const Points& points, const Spacing& spacing, double total_volume) {
  FilledBody body;
  body.positions = points;
  body.lattice = spacing.lattice;
  const bool lattice = spacing.lattice.regular;
  const double apart = spacing.lattice.spacing;
  double sum = 0;
  for (const double s : spacing.local) {
    const double ratio = lattice ? 1.0 : std::clamp(s / spacing.typical, 0.5, 2.0);
    body.volumes.push_back(ratio * ratio * ratio);
    sum += body.volumes.back();
  }
  const char* source = "given";
  if (total_volume > 0) {
    body.volume = total_volume;
  } else if (lattice) {
    body.volume = static_cast<double>(points.size()) * apart * apart * apart;
    source = "of their lattice";
  } else {
    body.volume = closed_hull(points, apart).volume;
    source = "estimated from their hull";
  }
  for (double& volume : body.volumes) volume *= body.volume / sum;
  body.report = fmt::format(
      "{} imported points are the particles, about {:.4g} m apart{}; volume "
      "{:.6g} m³ ({}).",
      points.size(), apart, lattice ? " on a regular lattice" : "", body.volume, source);
  return body;
}

void check_gaussians(const GaussianArrays& splats, const GaussianFillOptions& options) {
  const std::size_t count = splats.centres.size();
  if (splats.scales.size() != count || splats.rotations.size() != count ||
      splats.opacities.size() != count) {
    throw_input(fmt::format(
        "Gaussians to fill: {} centres, {} scales, {} rotations, {} opacities; expected equally "
        "many of each.",
        count, splats.scales.size(), splats.rotations.size(), splats.opacities.size()));
  }
  if (!(options.level > 0) || !(options.closing >= 0) || options.closing > 20) {
    throw_input("Gaussians to fill: level must be above 0 and closing between 0 and 20.");
  }
}

/// level − Σ opacity·exp(−½ d²): negative inside.
FloatGrid::Ptr density_grid(const GaussianArrays& splats, double voxel, std::size_t limit,
                            const GaussianFillOptions& options, std::size_t& used) {
  auto grid = FloatGrid::create(static_cast<float>(options.level));
  grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
  auto access = grid->getUnsafeAccessor();
  const double widened = 0.5 * voxel;
  double work = 0;
  used = 0;
  for (std::size_t i = 0; i < splats.centres.size(); ++i) {
    const double opacity = splats.opacities[i];
    if (!(opacity >= options.opacity_threshold) || !splats.centres[i].allFinite() ||
        !splats.scales[i].allFinite() || !(splats.rotations[i].norm() > 0)) {
      continue;
    }
    ++used;
    const Mat3d turn = splats.rotations[i].normalized().toRotationMatrix();
    const Vec3d variances = splats.scales[i].cwiseAbs2() + Vec3d::Constant(widened * widened);
    const Mat3d precision = turn * variances.cwiseInverse().asDiagonal() * turn.transpose();
    const Vec3d reach =
        3.0 * (turn * variances.asDiagonal() * turn.transpose()).diagonal().cwiseSqrt();
    const Vec3d low = (splats.centres[i] - reach) / voxel;
    const Vec3d high = (splats.centres[i] + reach) / voxel;
    work += (high - low + Vec3d::Ones()).prod();
    if (low.cwiseAbs().maxCoeff() > 1e8 || high.cwiseAbs().maxCoeff() > 1e8 || work > 4e9 ||
        static_cast<double>(grid->tree().leafCount()) * 512 > 64.0 * double(limit)) {
      throw_input(
          fmt::format("Gaussians to fill: at a particle_separation of {:.4g} m they cover too many "
                      "cells (splat "
                      "{} alone is {:.4g} m wide). Leave out background splats, raise the opacity "
                      "threshold, or "
                      "use a larger separation.",
                      2 * voxel, i, (2 * reach).maxCoeff()));
    }
    for (int x = static_cast<int>(std::ceil(low.x())); x <= high.x(); ++x) {
      for (int y = static_cast<int>(std::ceil(low.y())); y <= high.y(); ++y) {
        for (int z = static_cast<int>(std::ceil(low.z())); z <= high.z(); ++z) {
          const Vec3d off = voxel * Vec3d(x, y, z) - splats.centres[i];
          const double squared = off.dot(precision * off);
          if (squared > 9.0) continue;
          const openvdb::Coord at(x, y, z);
          access.setValueOn(
              at, access.getValue(at) - static_cast<float>(opacity * std::exp(-0.5 * squared)));
        }
      }
    }
  }
  return grid;
}

/// How far the level surface moved outward because splats were widened: of the median splat, with
/// the median density at centres, √(σ² + w²) and σ times √(2 ln(density/level)).
double widening(const GaussianArrays& splats, const FloatGrid& grid, double voxel,
                const GaussianFillOptions& options) {
  std::vector<double> thickness;
  std::vector<double> densities;
  for (std::size_t i = 0; i < splats.centres.size(); ++i) {
    const Vec3d index = (splats.centres[i] / voxel).array().round();
    if (!(splats.opacities[i] >= options.opacity_threshold) ||
        !(index.cwiseAbs().maxCoeff() < 1e8) || !splats.scales[i].allFinite()) {
      continue;
    }
    const openvdb::Coord at(static_cast<int>(index.x()), static_cast<int>(index.y()),
                            static_cast<int>(index.z()));
    thickness.push_back(splats.scales[i].minCoeff());
    densities.push_back(options.level - static_cast<double>(grid.tree().getValue(at)));
  }
  if (densities.empty()) return 0.0;
  const double sigma = median(thickness);
  const double ratio = median(densities) / options.level;
  return (std::hypot(sigma, 0.5 * voxel) - sigma) * std::sqrt(2.0 * std::log(std::max(1.0, ratio)));
}

}  // namespace

FilledBody fill_points(const Points& points, const FillOptions& options, double total_volume) {
  check_points(points, options);
  if (!std::isfinite(total_volume) || total_volume < 0) {
    throw_input("Points to fill: the total volume must be finite and not negative.");
  }
  openvdb::initialize();
  return particles_at(points, spacing_of(points, options), total_volume);
}

FilledBody fill_hull(const Points& points, const FillOptions& options) {
  check_points(points, options);
  openvdb::initialize();
  const Spacing spacing = spacing_of(points, options);
  if (spacing.lattice.regular) return particles_at(points, spacing, 0.0);
  FilledBody body = fill_mesh(closed_hull(points, spacing.lattice.spacing).mesh, options);
  body.report = fmt::format("The hull of {} imported points about {:.4g} m apart: ", points.size(),
                            spacing.lattice.spacing) +
                body.report;
  return body;
}

FilledBody fill_gaussians(const GaussianArrays& splats, const FillOptions& options,
                          const GaussianFillOptions& gaussian_options) {
  check_gaussians(splats, gaussian_options);
  if (!(options.separation > 0) || !std::isfinite(options.separation)) {
    throw_input("particle_separation must be above 0.");
  }
  openvdb::initialize();
  const double voxel = 0.5 * options.separation;
  std::size_t used = 0;
  const FloatGrid::Ptr density = density_grid(splats, voxel, options.limit, gaussian_options, used);
  Mesh mesh = surface_of(*density, 0.0, false);
  if (mesh.face_sizes.empty()) {
    throw_input(fmt::format(
        "Gaussians to fill: none of {} splats reaches the level {} ({} are above the opacity "
        "threshold {}). Lower the threshold or the level, or check the unit.",
        splats.centres.size(), gaussian_options.level, used, gaussian_options.opacity_threshold));
  }
  const double closing = gaussian_options.closing * options.separation;
  if (gaussian_options.fill_inside) {
    // OpenVDB's level sets know no cavities, so only the outer surface is moved.
    if (closing > 0) mesh = offset_surface(mesh, closing, voxel, true);
    if (closing == 0) mesh = surface_of(*density, 0.0, true);
    const double inward = closing + widening(splats, *density, voxel, gaussian_options);
    mesh = offset_surface(mesh, -inward, voxel, true);
    if (mesh.face_sizes.empty()) {
      throw_input(
          "Gaussians to fill: what they enclose is thinner than the particle_separation; use "
          "a smaller one.");
    }
  }
  FilledBody body = fill_mesh(mesh, options);
  body.report = fmt::format("{} of {} splats{}: ", used, splats.centres.size(),
                            gaussian_options.fill_inside ? ", inside filled" : "") +
                body.report;
  return body;
}

}  // namespace matterfit::capture
