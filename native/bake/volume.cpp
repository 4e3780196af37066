// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/volume.hpp"

#include <openvdb/tools/FastSweeping.h>
#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/Prune.h>

#include <cmath>
#include <memory>
#include <vector>

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

using Leaf = openvdb::FloatTree::LeafNodeType;
using MaskLeaf = openvdb::MaskTree::LeafNodeType;

/// Voxels on either side of the contour: those with one of six neighbours on the other side.
openvdb::MaskTree contour_mask(const openvdb::FloatTree& colour, Arena& arena) {
  std::vector<const Leaf*> leaves;
  for (auto leaf = colour.cbeginLeaf(); leaf; ++leaf) leaves.push_back(&*leaf);
  std::vector<std::unique_ptr<MaskLeaf>> masks(leaves.size());
  arena.parallel_for(0, leaves.size(), 16, [&](std::size_t i) {
    openvdb::tree::ValueAccessor<const openvdb::FloatTree> accessor(colour);
    for (auto value = leaves[i]->cbeginValueAll(); value; ++value) {
      const bool inside = *value > kIso;
      const openvdb::Coord xyz = value.getCoord();
      for (int axis = 0; axis < 3; ++axis) {
        for (const int step : {-1, 1}) {
          openvdb::Coord neighbour = xyz;
          neighbour[axis] += step;
          if ((accessor.getValue(neighbour) > kIso) == inside) continue;
          if (!masks[i]) masks[i] = std::make_unique<MaskLeaf>(leaves[i]->origin(), false);
          masks[i]->setValueOn(value.pos());
          // The far side may lie in a leaf that no kernel reaches; dilation brings it in.
        }
      }
    }
  });
  openvdb::MaskTree mask;
  for (auto& leaf : masks) {
    if (leaf) mask.addLeaf(leaf.release());
  }
  return mask;
}

/// Signed distance within the band from the color field.
openvdb::FloatGrid::Ptr level_set(const openvdb::FloatGrid& colour, double voxel_size, double band,
                                  Arena& arena) {
  auto result = empty_level_set(voxel_size, band);
  openvdb::MaskTree mask = contour_mask(colour.constTree(), arena);
  if (mask.empty()) return result;  // fast sweeping returns infinities where there is no contour

  // Sweep the band only, not the whole body: its voxels are active, all keep their values.
  openvdb::tools::dilateActiveValues(mask, static_cast<int>(std::ceil(band)) + 1,
                                     openvdb::tools::NN_FACE_EDGE_VERTEX,
                                     openvdb::tools::PRESERVE_TILES);
  const auto field = colour.deepCopy();
  for (auto leaf = field->tree().beginLeaf(); leaf; ++leaf) {
    const MaskLeaf* active = mask.probeConstLeaf(leaf->origin());
    if (active != nullptr) {
      leaf->setValueMask(active->getValueMask());
    } else {
      leaf->setValuesOff();
    }
  }
  field->tree().topologyUnion(mask);
  const auto distance = openvdb::tools::fogToSdf(*field, kIso);
  const auto limit = static_cast<float>(band * voxel_size);
  for (auto leaf = distance->tree().cbeginLeaf(); leaf; ++leaf) {
    const Leaf* inside = colour.constTree().probeConstLeaf(leaf->origin());
    auto* copy = new Leaf(leaf->origin(), limit, false);
    for (openvdb::Index i = 0; i < Leaf::SIZE; ++i) {
      if (leaf->isValueOn(i) && std::abs(leaf->getValue(i)) < limit) {
        copy->setValueOn(i, leaf->getValue(i));
      } else if (inside != nullptr && inside->getValue(i) > kIso) {
        copy->setValueOff(i, -limit);
      }
    }
    result->tree().addLeaf(copy);
  }
  openvdb::tools::pruneLevelSet(result->tree(), limit, -limit);
  return result;
}

double smallest_separation(std::span<const capture::ParticleView> bodies) {
  double result = 0.0;
  for (const capture::ParticleView& body : bodies) {
    if (body.separation > 0.0 && (result == 0.0 || body.separation < result)) {
      result = body.separation;
    }
  }
  return result > 0.0 ? result : 1.0;  // no bodies: any voxel size describes nothing
}

}  // namespace

openvdb::GridPtrVec make_volume(std::span<const capture::ParticleView> bodies,
                                const VolumeOptions& options, Arena& arena,
                                const Interrupter& interrupter) {
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
    raster_options.flows = options.flows;
    const Raster raster = rasterize(bodies, raster_options, arena, interrupter);
    openvdb::FloatGrid::Ptr surface;
    arena.execute(
        [&] { surface = level_set(*raster.colour, surface_voxel_size, options.band, arena); });
    surface->setName("surface");
    surface->setGridClass(openvdb::GRID_LEVEL_SET);
    grids.push_back(surface);
    interrupter.check();
  }
  for (const auto& grid : grids) grid->setSaveFloatAsHalf(options.half_float);
  return grids;
}

VolumeReport write_volume(const std::filesystem::path& path,
                          std::span<const capture::ParticleView> bodies,
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
