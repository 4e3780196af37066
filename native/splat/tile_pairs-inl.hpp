// SPDX-License-Identifier: GPL-3.0-or-later
// Which patches of which tiles a Gaussian touches. Included once per SIMD target.
//
// A register is a patch of lanes/2 × 2 pixels; a tile's pixels lie patch by patch, row of patches
// after row of patches.
#if defined(MATTERFIT_SPLAT_TILE_PAIRS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_SPLAT_TILE_PAIRS_INL_HPP
#undef MATTERFIT_SPLAT_TILE_PAIRS_INL_HPP
#else
#define MATTERFIT_SPLAT_TILE_PAIRS_INL_HPP
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <algorithm>
#include <bit>

#include "splat/frame.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::ScalableTag<float>;
using FloatVector = hn::Vec<FloatTag>;
inline constexpr std::size_t kPatch = hn::MaxLanes(FloatTag());
inline constexpr std::size_t kPatchWidth = kPatch / 2;
inline constexpr std::size_t kPatchColumns = splat::kTile / kPatchWidth;
inline constexpr std::size_t kPatches = splat::kTilePixels / kPatch;
inline constexpr std::size_t kPatchRows = splat::kTile / 2;
static_assert(kPatches <= 64);

inline constexpr std::size_t kPatchesLog2 = static_cast<std::size_t>(std::bit_width(kPatches)) - 1;

/// Places of a tile's pixels in its memory.
struct TileMap {
  alignas(64) float x[splat::kTilePixels];  ///< about the tile's centre
  alignas(64) float y[splat::kTilePixels];
  std::uint8_t column[splat::kTilePixels];
  std::uint8_t row[splat::kTilePixels];
  /// Bits of the patches of one column, by those of its rows.
  std::uint64_t spread[1U << kPatchRows];
};

inline const TileMap& tile_map() {
  static const TileMap kMap = [] {
    TileMap map;
    for (std::size_t i = 0; i < splat::kTilePixels; ++i) {
      const std::size_t patch = i / kPatch;
      const std::size_t lane = i % kPatch;
      const std::size_t column = patch % kPatchColumns * kPatchWidth + lane % kPatchWidth;
      const std::size_t row = patch / kPatchColumns * 2 + lane / kPatchWidth;
      map.column[i] = static_cast<std::uint8_t>(column);
      map.row[i] = static_cast<std::uint8_t>(row);
      map.x[i] = static_cast<float>(column) + 0.5F - 0.5F * splat::kTile;
      map.y[i] = static_cast<float>(row) + 0.5F - 0.5F * splat::kTile;
    }
    for (std::size_t rows = 0; rows < (1U << kPatchRows); ++rows) {
      map.spread[rows] = 0;
      for (std::size_t r = 0; r < kPatchRows; ++r) {
        map.spread[rows] |= (rows >> r & std::uint64_t{1}) << (r * kPatchColumns);
      }
    }
    return map;
  }();
  return kMap;
}

/// Columns of patches, counted on over a row of tiles, whose pixels may have α ≥ 1/255: the first
/// and the last of each row of patches; low > high where there is none.
struct PatchIntervals {
  alignas(64) std::int32_t low[kPatchRows];
  alignas(64) std::int32_t high[kPatchRows];
};

/// Tiles that are counted over from one: rounding grows with the distance from it.
inline constexpr int kRowOfTiles = 64;

/// In each row of pixels those are |u| ≤ √(E − w²) with E = log₂ σ − log₂ 1/255, an interval.
/// `u0` and `w0` are of the first tile's centre, `inverse` is 1/l11.
HWY_INLINE PatchIntervals patch_intervals(float u0, float w0, float inverse, float l21, float l22,
                                          float e) {
  const hn::CappedTag<float, splat::kTile> d;
  const hn::RebindToSigned<decltype(d)> di;
  using V = hn::Vec<decltype(d)>;
  // The interval may only be too wide. Rounding in a tile's own sums is 1e-5 pixels at most, over
  // kRowOfTiles of them 1e-3. A reciprocal root of 11 bits will do.
  constexpr float kSlack = 4e-3F;
  constexpr float kWider = 1.001F;
  constexpr float kNone = 1 << 24;
  // Rows 0, 2, 4 …, then 1, 3, 5 …: a row of patches is the same lane of both halves.
  alignas(64) static constexpr float kRows[splat::kTile] = {
      -7.5F, -5.5F, -3.5F, -1.5F, 0.5F, 2.5F, 4.5F, 6.5F,
      -6.5F, -4.5F, -2.5F, -0.5F, 1.5F, 3.5F, 5.5F, 7.5F};
  alignas(64) std::int32_t low[splat::kTile];
  alignas(64) std::int32_t high[splat::kTile];
  const V zero = hn::Zero(d);
  const V limit = hn::Set(d, e + kSlack);
  const V scale = hn::Set(d, inverse);
  // Pixel i is at X = i − 7.5.
  const V begin_at = hn::Set(d, 0.5F * splat::kTile - 0.5F - kSlack);
  const V end_at = hn::Set(d, 0.5F * splat::kTile - 0.5F + kSlack);
  const V per_patch = hn::Set(d, 1.0F / static_cast<float>(kPatchWidth));
  for (std::size_t i = 0; i < splat::kTile; i += hn::Lanes(d)) {
    const V y = hn::Load(d, kRows + i);
    const V w = hn::MulAdd(hn::Set(d, l22), y, hn::Set(d, w0));
    const V rest = hn::NegMulAdd(w, w, limit);
    const V positive = hn::Max(rest, hn::Set(d, 1e-6F));
    const V half =
        hn::Mul(hn::Mul(positive, hn::Set(d, kWider)), hn::ApproximateReciprocalSqrt(positive));
    const V u = hn::MulAdd(hn::Set(d, l21), y, hn::Set(d, u0));
    const V from = hn::Ceil(hn::NegMulAdd(hn::Add(u, half), scale, begin_at));
    const V to = hn::Floor(hn::MulAdd(hn::Sub(half, u), scale, end_at));
    const auto some = hn::And(hn::Ge(rest, zero), hn::Le(from, to));
    const V first = hn::Floor(hn::Mul(hn::Max(from, hn::Set(d, -kNone)), per_patch));
    const V last = hn::Floor(hn::Mul(hn::Min(to, hn::Set(d, kNone)), per_patch));
    hn::Store(hn::ConvertTo(di, hn::IfThenElse(some, first, hn::Set(d, kNone))), di, low + i);
    hn::Store(hn::ConvertTo(di, hn::IfThenElse(some, last, hn::Set(d, -kNone))), di, high + i);
  }
  PatchIntervals result;
  const hn::CappedTag<std::int32_t, kPatchRows> dr;
  for (std::size_t i = 0; i < kPatchRows; i += hn::Lanes(dr)) {
    hn::Store(hn::Min(hn::Load(dr, low + i), hn::Load(dr, low + kPatchRows + i)), dr,
              result.low + i);
    hn::Store(hn::Max(hn::Load(dr, high + i), hn::Load(dr, high + kPatchRows + i)), dr,
              result.high + i);
  }
  return result;
}

/// Bits of a tile's patches in these intervals, `column` the first of its columns of patches.
HWY_INLINE std::uint64_t patches_of(const PatchIntervals& intervals, std::size_t column,
                                    const TileMap& map) {
  const hn::CappedTag<std::int32_t, kPatchRows> d;
  std::uint64_t patches = 0;
  for (std::size_t c = 0; c < kPatchColumns; ++c) {
    const auto at = hn::Set(d, static_cast<std::int32_t>(column + c));
    std::size_t rows = 0;
    for (std::size_t i = 0; i < kPatchRows; i += hn::Lanes(d)) {
      const auto in = hn::Not(hn::Or(hn::Gt(hn::Load(d, intervals.low + i), at),
                                     hn::Gt(at, hn::Load(d, intervals.high + i))));
      std::uint8_t bits[8];
      hn::StoreMaskBits(d, in, bits);
      rows |= static_cast<std::size_t>(bits[0]) << i;
    }
    patches |= map.spread[rows] << c;
  }
  return patches;
}

/// Tiles [first, last] that the interval mean ± half of pixel coordinates reaches.
HWY_INLINE bool tile_range(double mean, double half, int tiles, int& first, int& last) {
  const double low = std::max((mean - half) / splat::kTile, 0.0);
  const double high = std::min((mean + half) / splat::kTile, static_cast<double>(tiles));
  if (!(low < high)) return false;
  first = static_cast<int>(low);
  last = std::min(static_cast<int>(high), tiles - 1);
  return true;
}

inline void find_pairs(splat::Frame& frame, std::size_t chunk) {
  splat::ChunkPairs& out = frame.chunks[chunk];
  const TileMap& map = tile_map();
  const std::size_t tiles = frame.tiles();
  std::uint32_t* counts = frame.offsets.data() + chunk * tiles;
  std::fill(counts, counts + tiles, 0U);
  const std::size_t begin = chunk * splat::kChunk;
  const std::size_t end = std::min(begin + splat::kChunk, frame.order.size());
  constexpr std::size_t kAhead = 8;  // places in the order; the footprints lie anywhere
  std::size_t size = 0;
  for (std::size_t rank = begin; rank < end; ++rank) {
    const splat::Footprint& f = frame.footprints[frame.order[rank]];
    if (rank + kAhead < end) {
      const auto* next =
          reinterpret_cast<const char*>(&frame.footprints[frame.order[rank + kAhead]]);
      hwy::Prefetch(next);
      hwy::Prefetch(next + 64);
    }
    splat::Shade& shade = frame.shades[rank];
    shade = {static_cast<float>(f.l11),
             static_cast<float>(f.l21),
             static_cast<float>(f.l22),
             f.log2_opacity,
             {f.colour[0], f.colour[1], f.colour[2]},
             f.depth};
    const std::size_t own = size;
    std::uint32_t& slots = frame.first_slot[frame.order[rank] + 1];  // 0 so far
    int x0 = 0;
    int x1 = -1;
    int y0 = 0;
    int y1 = -1;
    if (!tile_range(f.mean[0], f.half[0], frame.tiles_x, x0, x1) ||
        !tile_range(f.mean[1], f.half[1], frame.tiles_y, y0, y1)) {
      continue;
    }
    const float e = f.log2_opacity - static_cast<float>(splat::kSmallestLog2);
    const auto inverse = static_cast<float>(1.0 / f.l11);
    const std::size_t most =
        size + static_cast<std::size_t>(x1 - x0 + 1) * static_cast<std::size_t>(y1 - y0 + 1);
    if (out.tiles.size() < most) {
      out.pairs.resize(2 * most);
      out.tiles.resize(2 * most);
    }
    splat::Pair* const pairs = out.pairs.data();
    std::uint32_t* const tile_of = out.tiles.data();
    for (int ty = y0; ty <= y1; ++ty) {
      const double dy = (ty + 0.5) * splat::kTile - f.mean[1];
      const auto w0 = static_cast<float>(f.l22 * dy);
      const double u_row = f.l21 * dy - f.l11 * f.mean[0];
      const auto u_of = [&](int tx) {
        return static_cast<float>(u_row + f.l11 * ((tx + 0.5) * splat::kTile));
      };
      for (int from = x0; from <= x1; from += kRowOfTiles) {
        const PatchIntervals intervals =
            patch_intervals(u_of(from), w0, inverse, shade.l21, shade.l22, e);
        const int last = std::min(x1, from + kRowOfTiles - 1);
        for (int tx = from; tx <= last; ++tx) {
          const std::uint64_t patches =
              patches_of(intervals, static_cast<std::size_t>(tx - from) * kPatchColumns, map);
          const auto tile = static_cast<std::uint32_t>(ty * frame.tiles_x + tx);
          pairs[size] = {patches, static_cast<std::uint32_t>(rank),
                         static_cast<std::uint32_t>(size - own), u_of(tx), w0};
          tile_of[size] = tile;
          // The next is written over one that touches no patch.
          const std::uint32_t touches = patches == 0 ? 0 : 1;
          counts[tile] += touches;
          size += touches;
        }
      }
    }
    slots = static_cast<std::uint32_t>(size - own);
  }
  out.count = size;
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
