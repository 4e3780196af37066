// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/volume.hpp"

#include <openvdb/tools/FastSweeping.h>
#include <openvdb/tools/Prune.h>

#include <cmath>

#include "bake/rasterize.hpp"
#include "base/error.hpp"

namespace matterfit::bake {
namespace {

constexpr float kIso = 0.5F;

openvdb::FloatGrid::Ptr empty_level_set(double voxel_size, double band) {
  auto grid = openvdb::FloatGrid::create(static_cast<float>(band * voxel_size));
  grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel_size));
  return grid;
}

/// Signed distance within the band from the color field.
openvdb::FloatGrid::Ptr level_set(const openvdb::FloatGrid& colour, double voxel_size,
                                  double band) {
  auto result = empty_level_set(voxel_size, band);
  bool inside = false;
  for (auto leaf = colour.tree().cbeginLeaf(); leaf && !inside; ++leaf) {
    for (auto value = leaf->cbeginValueOn(); value; ++value) {
      if (*value > kIso) {
        inside = true;
        break;
      }
    }
  }
  if (!inside) return result;  // fast sweeping returns infinities where there is no contour

  auto distance = openvdb::tools::fogToSdf(colour, kIso);
  // Outside, kernels end two voxels from the contour or nearer.
  distance = openvdb::tools::dilateSdf(*distance, static_cast<int>(std::ceil(band)));
  const auto limit = static_cast<float>(band * voxel_size);
  using Leaf = openvdb::FloatTree::LeafNodeType;
  for (auto leaf = distance->tree().cbeginLeaf(); leaf; ++leaf) {
    auto* copy = new Leaf(leaf->origin(), limit, false);
    for (auto value = leaf->cbeginValueOn(); value; ++value) {
      if (std::abs(*value) < limit) {
        copy->setValueOn(value.pos(), *value);
      } else if (*value < 0.0F) {
        copy->setValueOff(value.pos(), -limit);
      }
    }
    result->tree().addLeaf(copy);
  }
  openvdb::tools::pruneLevelSet(result->tree(), limit, -limit);
  return result;
}

double smallest_separation(std::span<const ParticleView> bodies) {
  double result = 0.0;
  for (const ParticleView& body : bodies) {
    if (body.separation > 0.0 && (result == 0.0 || body.separation < result)) {
      result = body.separation;
    }
  }
  return result > 0.0 ? result : 1.0;  // no bodies: any voxel size describes nothing
}

}  // namespace

openvdb::GridPtrVec make_volume(std::span<const ParticleView> bodies, const VolumeOptions& options,
                                Arena& arena, const Interrupter& interrupter) {
  initialize_openvdb();
  if (!(options.band >= 1.0 && options.band <= 100.0)) {
    throw_input("the level set's band is " + std::to_string(options.band) +
                " voxels, expected 1 to 100.");
  }
  const double separation = smallest_separation(bodies);
  const double voxel_size = options.voxel_size > 0.0 ? options.voxel_size : separation;
  double surface_voxel_size = options.surface_voxel_size;
  if (surface_voxel_size <= 0.0) {
    surface_voxel_size = options.voxel_size > 0.0 ? voxel_size : separation / 2.0;
  }

  openvdb::GridPtrVec grids;
  if (options.density || options.velocity) {
    RasterOptions raster_options;
    raster_options.voxel_size = voxel_size;
    raster_options.density = options.density;
    raster_options.velocity = options.velocity;
    const Raster raster = rasterize(bodies, raster_options, arena, interrupter);
    if (raster.density) {
      raster.density->setName("density");
      raster.density->setGridClass(openvdb::GRID_FOG_VOLUME);
      grids.push_back(raster.density);
    }
    if (raster.velocity) {
      raster.velocity->setName("velocity");
      raster.velocity->setVectorType(openvdb::VEC_CONTRAVARIANT_RELATIVE);
      grids.push_back(raster.velocity);
    }
  }
  if (options.surface) {
    RasterOptions raster_options;
    raster_options.voxel_size = surface_voxel_size;
    raster_options.colour = true;
    raster_options.droplets = options.droplets;
    const Raster raster = rasterize(bodies, raster_options, arena, interrupter);
    openvdb::FloatGrid::Ptr surface;
    arena.execute([&] { surface = level_set(*raster.colour, surface_voxel_size, options.band); });
    surface->setName("surface");
    surface->setGridClass(openvdb::GRID_LEVEL_SET);
    grids.push_back(surface);
    interrupter.check();
  }
  for (const auto& grid : grids) grid->setSaveFloatAsHalf(options.half_float);
  return grids;
}

VolumeReport write_volume(const std::filesystem::path& path, std::span<const ParticleView> bodies,
                          const VolumeOptions& options, Arena& arena,
                          const Interrupter& interrupter) {
  const openvdb::GridPtrVec grids = make_volume(bodies, options, arena, interrupter);
  VolumeReport report;
  openvdb::GridCPtrVec constant(grids.begin(), grids.end());
  for (const auto& grid : grids) {
    report.grids.push_back({grid->getName(), grid->activeVoxelCount()});
  }
  arena.execute([&] { report.bytes = write_vdb(path, constant, options.compression); });
  return report;
}

}  // namespace matterfit::bake
