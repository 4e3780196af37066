// SPDX-License-Identifier: GPL-3.0-or-later
#include "splat/rasteriser.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>

#include "base/error.hpp"
#include "splat/check.hpp"
#include "splat/frame.hpp"

namespace matterfit::splat {
namespace {

constexpr std::size_t kTileGrain = 4;

std::size_t chunks_of(std::size_t count) { return (count + kChunk - 1) / kChunk; }

struct Keyed {
  std::uint32_t key;
  std::uint32_t index;
};

/// Sorts by key; equal keys keep their order. Radix sort in three passes of eleven bits.
void sort_by_key(std::vector<Keyed>& items, std::vector<Keyed>& other) {
  constexpr unsigned kBits = 11;
  constexpr std::size_t kBuckets = 1U << kBits;
  other.resize(items.size());
  for (unsigned shift = 0; shift < 33; shift += kBits) {
    std::array<std::uint32_t, kBuckets> begin{};
    for (const Keyed& item : items) ++begin[(item.key >> shift) & (kBuckets - 1)];
    std::uint32_t sum = 0;
    for (std::uint32_t& value : begin) sum += std::exchange(value, sum);
    for (const Keyed& item : items) other[begin[(item.key >> shift) & (kBuckets - 1)]++] = item;
    items.swap(other);
  }
}

}  // namespace

Image::Image(int image_width, int image_height) : width(image_width), height(image_height) {
  const std::size_t count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  colour.assign(3 * count, 0.0F);
  mask.assign(count, 0.0F);
  depth.assign(count, 0.0F);
}

struct Rasteriser::Work {
  std::shared_ptr<Arena> arena;
  const Kernels& kernels;
  Frame frame;
  std::vector<Keyed> keys;
  std::vector<Keyed> spare_keys;

  void order_by_depth();
  void fill_tiles();
};

Rasteriser::Rasteriser(std::shared_ptr<Arena> arena, SimdTarget target)
    : work_(new Work{std::move(arena), kernels(target), {}, {}, {}}) {}
Rasteriser::~Rasteriser() = default;

void Rasteriser::Work::order_by_depth() {
  keys.clear();
  for (std::size_t i = 0; i < frame.depth_keys.size(); ++i) {
    if (frame.depth_keys[i] != kUnseen) {
      keys.push_back({frame.depth_keys[i], static_cast<std::uint32_t>(i)});
    }
  }
  sort_by_key(keys, spare_keys);
  frame.order.resize(keys.size());
  for (std::size_t rank = 0; rank < keys.size(); ++rank) frame.order[rank] = keys[rank].index;
}

void Rasteriser::Work::fill_tiles() {
  const std::size_t seen = frame.order.size();
  const std::size_t chunks = chunks_of(seen);
  const std::size_t tiles = frame.tiles();
  frame.shades.resize(seen);
  frame.first_slot.assign(frame.footprints.size() + 1, 0);
  if (frame.chunks.size() < chunks) frame.chunks.resize(chunks);
  frame.offsets.resize(chunks * tiles);
  arena->parallel_for(0, chunks, 1, [&](std::size_t c) { kernels.find_pairs(frame, c); });

  // Offsets at which each chunk writes in each tile's list.
  frame.tile_begin.assign(tiles + 1, 0);
  std::uint64_t total = 0;
  for (std::size_t c = 0; c < chunks; ++c) {
    total += frame.chunks[c].count;
    std::uint32_t* offsets = frame.offsets.data() + c * tiles;
    for (std::size_t tile = 0; tile < tiles; ++tile) {
      frame.tile_begin[tile + 1] += std::exchange(offsets[tile], frame.tile_begin[tile + 1]);
    }
  }
  if (total > std::numeric_limits<std::uint32_t>::max()) {
    throw_compute("the Gaussians touch more than 2³² tiles. Render a smaller image or fewer.");
  }
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    frame.tile_begin[tile + 1] += frame.tile_begin[tile];
  }
  frame.pairs.resize(total);
  std::partial_sum(frame.first_slot.begin(), frame.first_slot.end(), frame.first_slot.begin());
  arena->parallel_for(0, chunks, 1, [&](std::size_t c) {
    const ChunkPairs& chunk = frame.chunks[c];
    std::uint32_t* offsets = frame.offsets.data() + c * tiles;
    for (std::size_t k = 0; k < chunk.count; ++k) {
      const std::uint32_t tile = chunk.tiles[k];
      Pair& pair = frame.pairs[frame.tile_begin[tile] + offsets[tile]++];
      pair = chunk.pairs[k];
      pair.slot += frame.first_slot[frame.order[pair.rank]];
    }
  });
}

const Image& Rasteriser::render(const Gaussians& gaussians, const Camera& camera,
                                const RenderOptions& options) {
  Work& work = *work_;
  Frame& frame = work.frame;
  check_camera(camera, options);
  check_gaussians(gaussians, *work.arena);
  frame.gaussians = nullptr;  // nothing to go back through until all is drawn
  frame.view = View(camera, options);
  frame.tiles_x = (camera.width + kTile - 1) / kTile;
  frame.tiles_y = (camera.height + kTile - 1) / kTile;
  if (frame.image.width != camera.width || frame.image.height != camera.height) {
    frame.blank.assign(frame.tiles(), 1);
    frame.image = Image(camera.width, camera.height);
  }
  const std::size_t count = gaussians.size();
  frame.footprints.resize(count);
  frame.depth_keys.resize(count);
  work.arena->parallel_for(0, chunks_of(count), 1, [&](std::size_t c) {
    work.kernels.project(frame, gaussians, c * kChunk, std::min((c + 1) * kChunk, count));
  });
  work.order_by_depth();
  work.fill_tiles();
  work.arena->parallel_for(0, frame.tiles(), kTileGrain,
                           [&](std::size_t tile) { work.kernels.render_tile(frame, tile); });
  frame.gaussians = &gaussians;
  return frame.image;
}

void Rasteriser::backward(const Gaussians& gaussians, const Image& loss_gradient,
                          GaussianGradients& gradients) {
  Work& work = *work_;
  Frame& frame = work.frame;
  if (frame.gaussians == nullptr || gaussians.size() != frame.footprints.size()) {
    throw_input("backward() is for the Gaussians that render() got last.");
  }
  frame.gaussians = &gaussians;
  check_loss_gradient(loss_gradient, frame.image.width, frame.image.height, *work.arena);
  const std::size_t count = gaussians.size();
  gradients.means.assign(count, Vec3f::Zero());
  gradients.log_scales.assign(count, Vec3f::Zero());
  gradients.rotations.assign(count, Eigen::Vector4f::Zero());
  gradients.opacities.assign(count, 0.0F);
  gradients.sh.assign(gaussians.sh.size(), 0.0F);
  gradients.deformation_gradients.assign(gaussians.deformation_gradients.size(), Mat3f::Zero());
  gradients.pose.fill(0.0);
  frame.loss = &loss_gradient;
  frame.gradients = &gradients;
  frame.slots.resize(frame.pairs.size());
  work.arena->parallel_for(0, frame.tiles(), kTileGrain,
                           [&](std::size_t tile) { work.kernels.differentiate_tile(frame, tile); });
  const std::size_t chunks = chunks_of(count);
  frame.pose.resize(6 * chunks);
  work.arena->parallel_for(0, chunks, 1, [&](std::size_t c) { work.kernels.gather(frame, c); });
  for (std::size_t c = 0; c < chunks; ++c) {
    for (std::size_t k = 0; k < 6; ++k) gradients.pose[k] += frame.pose[6 * c + k];
  }
}

Image render(const Gaussians& gaussians, const Camera& camera, const RenderOptions& options,
             int threads) {
  Rasteriser rasteriser(std::make_shared<Arena>(threads));
  return rasteriser.render(gaussians, camera, options);
}

}  // namespace matterfit::splat
