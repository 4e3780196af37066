// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "bake/vdb_file.hpp"
#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "capture/particles.hpp"

namespace matterfit::bake {

/// Which grids of a volume cache, and how fine. All are in world space [m].
struct VolumeOptions {
  /// FloatGrid "density", fog: density over rest density, 1 in undeformed bulk, 0 outside.
  bool density = true;
  /// Vec3SGrid "velocity" [m/s], at voxel centres, mass-weighted mean of the particles; active
  /// where density is. Blender: Volume.velocity_unit = SECOND.
  bool velocity = false;
  /// FloatGrid "surface", level set: signed distance [m] to the ½-contour of the color field
  /// (rasterize.hpp), negative inside, exact to first order (fast sweeping, Zhao 2004), within
  /// `band` voxels; ±band·voxel beyond.
  bool surface = false;
  double voxel_size = 0.0;          ///< [m]; 0: the smallest particle separation h
  double surface_voxel_size = 0.0;  ///< [m]; 0: voxel_size where given, else h / 2
  double band = 3.0;                ///< half width of the level set's band, in voxels
  bool half_float = true;           ///< values in the file as 16-bit floats
  bool droplets = true;             ///< single particles have a surface (rasterize.hpp)
  bool flows = false;               ///< the surface is that of a fluid or paste (rasterize.hpp)
  VdbCompression compression = VdbCompression::kBlosc;
};

struct VolumeReport {
  struct Grid {
    std::string name;
    std::uint64_t active_voxels = 0;
  };
  std::vector<Grid> grids;
  std::uint64_t bytes = 0;  ///< of the file
};

/// The grids in memory, in the order density, velocity, surface; empty ones without particles.
/// Throws Error(kInput), Error(kCompute) and Error(kCancelled) as rasterize() does.
[[nodiscard]] openvdb::GridPtrVec make_volume(std::span<const capture::ParticleView> bodies,
                                              const VolumeOptions& options, Arena& arena,
                                              const Interrupter& interrupter);

/// Writes one frame of one or more bodies as a VDB file. Equal input gives equal bytes for any
/// number of threads. Throws what make_volume throws, and Error(kOutput).
VolumeReport write_volume(const std::filesystem::path& path,
                          std::span<const capture::ParticleView> bodies,
                          const VolumeOptions& options, Arena& arena,
                          const Interrupter& interrupter);

}  // namespace matterfit::bake
