// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/rasterize.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "bake/flow_kernels.hpp"
#include "base/error.hpp"

namespace matterfit::bake {
namespace {

constexpr int kLeafSide = 8;
constexpr int kLeafVoxels = kLeafSide * kLeafSide * kLeafSide;
constexpr double kSupport = 1.5;        // of the quadratic B-spline, in spacings
constexpr double kIndexLimit = 1.0e9;   // voxels from the origin
constexpr double kVoxelLimit = 1.7e10;  // kernel voxels: some minutes of work

/// A kernel in index space (unit: one voxel).
struct Kernel {
  Vec3d centre;
  Mat3f to_rest;  ///< voxels → y
  Vec3f velocity;
  float weight = 0.0F;          ///< V_p / h³
  float density = 0.0F;         ///< weight / det F
  float droplet_radius = 0.0F;  ///< in y
  float inside = 0.0F;          ///< voxels that it covers
  Vec3i low;                    ///< first and last voxel of the box around it
  Vec3i high;

  /// What it costs: its voxels, and a glance at each row of the box.
  [[nodiscard]] double work() const {
    const Vec3i sides = (high - low + Vec3i::Ones()).cwiseMax(0);
    return double(inside) + double(sides[0]) * double(sides[1]);
  }
};

/// `flow`: of the body, or null.
Kernel make_kernel(const capture::ParticleView& body, const FlowKernels* flow, std::size_t i,
                   double voxel_size) {
  Kernel kernel;
  kernel.centre = body.positions[i].cast<double>() / voxel_size;
  Mat3d shape = body.axes.toRotationMatrix();
  double ratio = 1.0;
  double spread = 1.0;  // of a kernel's volume, over the particle's own
  if (flow != nullptr) {
    kernel.centre = flow->centres[i] / voxel_size;
    shape = flow->shapes[i] * shape;
    spread = flow->shapes[i].determinant();
  } else if (!body.deformation_gradients.empty()) {
    const capture::Stretch stretch =
        capture::principal_stretches(body.deformation_gradients[i].cast<double>());
    const Vec3d clamped =
        stretch.stretches.cwiseAbs().cwiseMax(1.0 / kStretchLimit).cwiseMin(kStretchLimit);
    shape = stretch.axes * clamped.asDiagonal() * stretch.rest_axes.transpose() * shape;
    ratio = clamped.prod();
  }
  const double h = body.separation;
  shape *= h / voxel_size;  // y → voxels
  kernel.to_rest = shape.inverse().cast<float>();
  kernel.inside = static_cast<float>(std::pow(2.0 * kSupport, 3) * std::abs(shape.determinant()));
  const double fill = body.volumes[i] / (h * h * h);
  kernel.weight = static_cast<float>(fill / spread);
  kernel.density = static_cast<float>(fill / ratio);
  kernel.droplet_radius = static_cast<float>(0.5 * std::cbrt(fill));
  if (!body.velocities.empty()) kernel.velocity = body.velocities[i];
  // Half the bounding box of the image of the cube |y| < 1.5.
  const Vec3d reach = kSupport * shape.cwiseAbs().rowwise().sum();
  const Vec3d low = kernel.centre - reach;
  const Vec3d high = kernel.centre + reach;
  if (low.minCoeff() < -kIndexLimit || high.maxCoeff() > kIndexLimit) {
    throw_input("body '" + body.name + "', particle " + std::to_string(i) +
                ": too far from the origin for voxels of " + std::to_string(voxel_size) +
                " m. Choose a larger voxel size.");
  }
  for (int k = 0; k < 3; ++k) {
    kernel.low[k] = static_cast<int>(std::ceil(low[k]));
    kernel.high[k] = static_cast<int>(std::floor(high[k]));
  }
  return kernel;
}

std::vector<Kernel> make_kernels(std::span<const capture::ParticleView> bodies,
                                 const RasterOptions& options, Arena& arena,
                                 const Interrupter& interrupter) {
  std::size_t count = 0;
  for (const capture::ParticleView& body : bodies) count += body.size();
  std::vector<Kernel> kernels(count);
  std::size_t first = 0;
  for (const capture::ParticleView& body : bodies) {
    std::optional<FlowKernels> flow;
    if (options.flows) flow = flow_kernels(body, arena, interrupter);
    arena.parallel_for(0, body.size(), 1024, [&](std::size_t i) {
      kernels[first + i] = make_kernel(body, flow ? &*flow : nullptr, i, options.voxel_size);
    });
    first += body.size();
  }
  return kernels;
}

/// Which kernels reach which leaf: leaves in lexical order, kernels ascending within each.
struct Blocks {
  struct Entry {
    std::array<std::int32_t, 3> leaf;  ///< leaf coordinates, voxel >> 3
    std::uint32_t kernel;
    bool operator<(const Entry& other) const {
      return leaf != other.leaf ? leaf < other.leaf : kernel < other.kernel;
    }
  };
  std::vector<Entry> entries;
  std::vector<std::size_t> first;  ///< of each leaf, and the end
};

Blocks make_blocks(const std::vector<Kernel>& kernels, double voxel_size) {
  double voxels = 0.0;
  for (const Kernel& kernel : kernels) voxels += kernel.work();
  if (voxels > kVoxelLimit) {
    throw_input("voxels of " + std::to_string(voxel_size) +
                " m are too fine for these particles (" +
                std::to_string(static_cast<std::uint64_t>(voxels / 1e6)) +
                " million kernel voxels). Choose a voxel size nearer the particle separation.");
  }
  Blocks blocks;
  for (std::size_t i = 0; i < kernels.size(); ++i) {
    const Kernel& kernel = kernels[i];
    if ((kernel.high - kernel.low).minCoeff() < 0) continue;  // between voxel centres
    for (int x = kernel.low[0] >> 3; x <= kernel.high[0] >> 3; ++x)
      for (int y = kernel.low[1] >> 3; y <= kernel.high[1] >> 3; ++y)
        for (int z = kernel.low[2] >> 3; z <= kernel.high[2] >> 3; ++z)
          blocks.entries.push_back({{x, y, z}, static_cast<std::uint32_t>(i)});
  }
  std::sort(blocks.entries.begin(), blocks.entries.end());
  for (std::size_t i = 0; i < blocks.entries.size(); ++i) {
    if (i == 0 || blocks.entries[i].leaf != blocks.entries[i - 1].leaf) blocks.first.push_back(i);
  }
  blocks.first.push_back(blocks.entries.size());
  return blocks;
}

/// Sums of one leaf; voxel (x, y, z) at 64 x + 8 y + z, the order of an OpenVDB leaf.
struct LeafSums {
  alignas(64) std::array<float, kLeafVoxels> colour{};
  alignas(64) std::array<float, kLeafVoxels> droplet{};
  alignas(64) std::array<float, kLeafVoxels> density{};
  std::array<std::array<float, kLeafVoxels>, 3> momentum{};
};

/// Quadratic B-spline, without branches so that the loop over z is one of SIMD registers.
inline float spline(float y) {
  const float a = std::abs(y);
  const float t = std::max(1.5F - a, 0.0F);
  const float u = std::max(0.5F - a, 0.0F);
  return 0.5F * t * t - 1.5F * u * u;
}

/// Whether a row of a leaf along z, y = base + z · step, meets the kernel's cube. A kernel that
/// lies flat and aslant fills a small part of its box.
inline bool meets(const Vec3f& base, const Vec3f& step) {
  constexpr float kRoundOff = 1e-4F;
  float first = 0.0F;
  float last = static_cast<float>(kLeafSide - 1);
  for (int k = 0; k < 3; ++k) {
    const auto reach = static_cast<float>(kSupport) + kRoundOff;
    if (std::abs(step[k]) < kRoundOff) {
      if (std::abs(base[k]) > reach + kRoundOff * kLeafSide) return false;
      continue;
    }
    const float one = (-reach - base[k]) / step[k];
    const float other = (reach - base[k]) / step[k];
    first = std::max(first, std::min(one, other));
    last = std::min(last, std::max(one, other));
  }
  return first <= last + kRoundOff;
}

void add_kernel(const Kernel& kernel, const Vec3i& origin, const RasterOptions& options,
                LeafSums& sums) {
  const Vec3i low = (kernel.low - origin).cwiseMax(0);
  const Vec3i high = (kernel.high - origin).cwiseMin(kLeafSide - 1);
  const Vec3f centre = (kernel.centre - origin.cast<double>()).cast<float>();
  const Mat3f& m = kernel.to_rest;
  alignas(64) std::array<float, kLeafSide> value{};
  for (int x = low[0]; x <= high[0]; ++x) {
    for (int y = low[1]; y <= high[1]; ++y) {
      const Vec3f d(static_cast<float>(x) - centre[0], static_cast<float>(y) - centre[1],
                    -centre[2]);
      const Vec3f base = m * d;
      if (!meets(base, m.col(2))) continue;
      const int row = 64 * x + 8 * y;
      for (int z = 0; z < kLeafSide; ++z) {
        const auto s = static_cast<float>(z);
        const float y0 = base[0] + m(0, 2) * s;
        const float y1 = base[1] + m(1, 2) * s;
        const float y2 = base[2] + m(2, 2) * s;
        value[z] = spline(y0) * spline(y1) * spline(y2);
      }
      if (options.colour) {
        for (int z = 0; z < kLeafSide; ++z) sums.colour[row + z] += kernel.weight * value[z];
        if (options.droplets) {
          for (int z = 0; z < kLeafSide; ++z) {
            const auto s = static_cast<float>(z);
            const float y0 = base[0] + m(0, 2) * s;
            const float y1 = base[1] + m(1, 2) * s;
            const float y2 = base[2] + m(2, 2) * s;
            // Falls by one over one spacing, as the color field does across a flat surface.
            const float ball =
                0.5F + kernel.droplet_radius - std::sqrt(y0 * y0 + y1 * y1 + y2 * y2);
            sums.droplet[row + z] = std::max(sums.droplet[row + z], ball);
          }
        }
      }
      if (options.density || options.velocity) {
        for (int z = 0; z < kLeafSide; ++z) sums.density[row + z] += kernel.density * value[z];
      }
      if (options.velocity) {
        for (int k = 0; k < 3; ++k) {
          const float momentum = kernel.density * kernel.velocity[k];
          for (int z = 0; z < kLeafSide; ++z) sums.momentum[k][row + z] += momentum * value[z];
        }
      }
    }
  }
}

template <class Grid>
typename Grid::Ptr grid_of_leaves(std::vector<typename Grid::TreeType::LeafNodeType*>& leaves,
                                  double voxel_size) {
  auto grid = Grid::create();
  grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel_size));
  for (auto* leaf : leaves) {
    if (leaf->isEmpty()) {
      delete leaf;
    } else {
      grid->tree().addLeaf(leaf);
    }
  }
  return grid;
}

}  // namespace

Raster rasterize(std::span<const capture::ParticleView> bodies, const RasterOptions& options,
                 Arena& arena, const Interrupter& interrupter) {
  if (!(options.voxel_size > 0.0) || !std::isfinite(options.voxel_size)) {
    throw_input("the voxel size is " + std::to_string(options.voxel_size) +
                " m, expected more than 0.");
  }
  for (const capture::ParticleView& body : bodies) check(body);
  const std::vector<Kernel> kernels = make_kernels(bodies, options, arena, interrupter);
  interrupter.check();
  const Blocks blocks = make_blocks(kernels, options.voxel_size);
  interrupter.check();

  using FloatLeaf = openvdb::FloatTree::LeafNodeType;
  using VectorLeaf = openvdb::Vec3STree::LeafNodeType;
  const std::size_t count = blocks.first.size() - 1;
  std::vector<FloatLeaf*> colour(options.colour ? count : 0, nullptr);
  std::vector<FloatLeaf*> density(options.density ? count : 0, nullptr);
  std::vector<VectorLeaf*> velocity(options.velocity ? count : 0, nullptr);
  arena.parallel_for(0, count, 4, [&](std::size_t b) {
    if (interrupter.cancelled()) return;
    const auto& leaf = blocks.entries[blocks.first[b]].leaf;
    const Vec3i origin(leaf[0] * kLeafSide, leaf[1] * kLeafSide, leaf[2] * kLeafSide);
    LeafSums sums;
    for (std::size_t e = blocks.first[b]; e < blocks.first[b + 1]; ++e) {
      add_kernel(kernels[blocks.entries[e].kernel], origin, options, sums);
    }
    const openvdb::Coord coord(origin[0], origin[1], origin[2]);
    if (options.colour) {
      colour[b] = new FloatLeaf(coord, 0.0F, false);
      for (int v = 0; v < kLeafVoxels; ++v) {
        const float value = std::max(sums.colour[v], sums.droplet[v]);
        if (value > 0.0F) colour[b]->setValueOn(static_cast<openvdb::Index>(v), value);
      }
    }
    if (options.density) {
      density[b] = new FloatLeaf(coord, 0.0F, false);
      for (int v = 0; v < kLeafVoxels; ++v) {
        if (sums.density[v] > 1e-6F) {
          density[b]->setValueOn(static_cast<openvdb::Index>(v), sums.density[v]);
        }
      }
    }
    if (options.velocity) {
      velocity[b] = new VectorLeaf(coord, openvdb::Vec3s(0.0F), false);
      for (int v = 0; v < kLeafVoxels; ++v) {
        if (sums.density[v] <= 1e-6F) continue;  // below, rounding would show in the quotient
        const float inverse = 1.0F / sums.density[v];
        velocity[b]->setValueOn(
            static_cast<openvdb::Index>(v),
            openvdb::Vec3s(sums.momentum[0][v] * inverse, sums.momentum[1][v] * inverse,
                           sums.momentum[2][v] * inverse));
      }
    }
  });
  if (interrupter.cancelled()) {
    for (auto* leaf : colour) delete leaf;
    for (auto* leaf : density) delete leaf;
    for (auto* leaf : velocity) delete leaf;
    interrupter.check();
  }
  Raster raster;
  if (options.colour) {
    raster.colour = grid_of_leaves<openvdb::FloatGrid>(colour, options.voxel_size);
  }
  if (options.density) {
    raster.density = grid_of_leaves<openvdb::FloatGrid>(density, options.voxel_size);
  }
  if (options.velocity) {
    raster.velocity = grid_of_leaves<openvdb::Vec3SGrid>(velocity, options.voxel_size);
  }
  return raster;
}

}  // namespace matterfit::bake
