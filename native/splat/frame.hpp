// SPDX-License-Identifier: GPL-3.0-or-later
// The rasteriser's working memory: one place that states the layout and why.
//
// Gaussians are projected in double, in index order; those that are seen are sorted once by depth
// and appended to the tiles in that order, so tile lists are born sorted. A Gaussian in a tile is a
// pair. A pair's footprint is u = u0 + l11 X + l21 Y, w = w0 + l22 Y in the tile's own coordinates
// (X, Y in ±7.5 about its centre), log₂ α = log₂ σ − u² − w²: u0 and w0 are formed in double, so
// single precision loses nothing on thin footprints far from their mean. A pair also owns a slot,
// where the backward pass leaves its sums; a Gaussian's slots lie together, by its index, and are
// added in the order of its tiles, hence the same bits for any number of threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "splat/gaussians.hpp"
#include "splat/rasteriser.hpp"
#include "splat/view.hpp"

namespace matterfit::splat {

inline constexpr int kTile = 16;  ///< pixels along an edge
inline constexpr std::size_t kTilePixels = std::size_t{kTile} * kTile;
/// Gaussians to a task. Fixed: partial sums are per chunk.
inline constexpr std::size_t kChunk = 512;
/// log₂ of kSmallestAlpha.
inline constexpr double kSmallestLog2 = -7.9943534368588579;
/// u² + w² = dᵀ Σ₂⁻¹ d · log₂(e) / 2.
inline constexpr double kHalfLog2E = 0.72134752044448170;
inline constexpr std::uint32_t kUnseen = 0xffffffffU;

/// A projected Gaussian, by its index.
struct Footprint {
  double mean[2];  ///< [pixels]
  double half[2];  ///< of the box that holds α ≥ 1/255 [pixels]
  double l11;
  double l21;
  double l22;
  float log2_opacity;
  float depth;
  float colour[3];
};

/// What tiles read of a Gaussian, by its place in the order of depth.
struct Shade {
  float l11;
  float l21;
  float l22;
  float log2_opacity;
  float colour[3];
  float depth;
};

struct Pair {
  std::uint64_t patches;  ///< bits of those that it may touch (tile_kernel-inl.hpp)
  std::uint32_t rank;     ///< in the order of depth
  std::uint32_t slot;
  float u0;
  float w0;
};

/// Sums over a tile's pixels, with v = ∂L/∂ln α: v, vu, vw, vu², vuw, vw², then the derivatives in
/// colour and depth; two more are 0.
inline constexpr std::size_t kSums = 12;
struct Slot {
  float sum[kSums];
};

/// Pairs that a chunk of the sorted Gaussians makes, in order. The vectors only grow.
struct ChunkPairs {
  std::vector<Pair> pairs;
  std::vector<std::uint32_t> tiles;  ///< of each pair
  std::size_t count;                 ///< of them
};

struct Frame {
  const Gaussians* gaussians = nullptr;
  View view{};
  int tiles_x = 0;
  int tiles_y = 0;

  std::vector<Footprint> footprints;      ///< (N)
  std::vector<std::uint32_t> depth_keys;  ///< (N) bits of the depth, or kUnseen
  std::vector<std::uint32_t> order;       ///< (seen) indices, by depth
  std::vector<Shade> shades;              ///< (seen)
  std::vector<std::uint32_t> first_slot;  ///< (N + 1) by index
  std::vector<ChunkPairs> chunks;         ///< of `order`
  std::vector<std::uint32_t> offsets;     ///< (chunks, tiles) where a chunk writes in a tile's list
  std::vector<std::uint32_t> tile_begin;  ///< (tiles + 1)
  std::vector<Pair> pairs;                ///< by tile
  Image image;
  std::vector<std::uint8_t> blank;  ///< (tiles) where `image` is 0

  const Image* loss = nullptr;  ///< derivatives in `image`
  std::vector<Slot> slots;
  GaussianGradients* gradients = nullptr;
  std::vector<double> pose;  ///< (chunks of the N, 6)

  [[nodiscard]] std::size_t tiles() const {
    return static_cast<std::size_t>(tiles_x) * static_cast<std::size_t>(tiles_y);
  }
};

struct Kernels {
  /// Footprints and depth keys of Gaussians [begin, end).
  void (*project)(Frame& frame, const Gaussians& gaussians, std::size_t begin, std::size_t end);
  /// Shades and pairs of a chunk of the order; slots count from 0 in each Gaussian, their number is
  /// left in first_slot of the next index.
  void (*find_pairs)(Frame& frame, std::size_t chunk);
  void (*render_tile)(Frame& frame, std::size_t tile);
  /// The slots of a tile's pairs.
  void (*differentiate_tile)(Frame& frame, std::size_t tile);
  /// Gradients of a chunk of the Gaussians by their index, and its part of the pose's.
  void (*gather)(Frame& frame, std::size_t chunk);
};

/// Throws Error(kInput) if the processor lacks the target.
[[nodiscard]] const Kernels& kernels(SimdTarget target);

}  // namespace matterfit::splat
