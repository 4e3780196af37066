// SPDX-License-Identifier: GPL-3.0-or-later
// Pairs of Gaussians and tiles, forward and backward. Included once per SIMD target.
//
// A register is a patch of lanes/2 × 2 pixels; a tile's pixels lie patch by patch, row of patches
// after row of patches.
#if defined(MATTERFIT_SPLAT_TILE_KERNEL_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_SPLAT_TILE_KERNEL_INL_HPP
#undef MATTERFIT_SPLAT_TILE_KERNEL_INL_HPP
#else
#define MATTERFIT_SPLAT_TILE_KERNEL_INL_HPP
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <type_traits>

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

/// Places of a tile's pixels in its memory.
struct TileMap {
  alignas(64) float x[splat::kTilePixels];  ///< about the tile's centre
  alignas(64) float y[splat::kTilePixels];
  std::uint8_t column[splat::kTilePixels];
  std::uint8_t row[splat::kTilePixels];
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
    return map;
  }();
  return kMap;
}

/// Bits of the patches whose pixels may have α ≥ 1/255: in each row of pixels
/// |u| ≤ √(E − w²) with E = log₂ σ − log₂ 1/255, an interval.
HWY_INLINE std::uint64_t patches_of(float u0, float w0, float l11, float l21, float l22, float e) {
  const hn::CappedTag<float, kPatchRows> d;
  const hn::RebindToSigned<decltype(d)> di;
  using V = hn::Vec<decltype(d)>;
  // Rounding in the tile's own sums is 1e-5 at most: the interval may only be too wide.
  constexpr float kSlack = 1e-3F;
  const V zero = hn::Zero(d);
  const V inverse = hn::Set(d, 1.0F / l11);
  const V limit = hn::Set(d, e + kSlack);
  alignas(64) std::int32_t bits[kPatchRows];
  constexpr std::int32_t kAll = (1 << kPatchColumns) - 1;
  for (std::size_t i = 0; i < kPatchRows; i += hn::Lanes(d)) {
    const V first = hn::MulAdd(hn::Iota(d, static_cast<float>(i)), hn::Set(d, 2.0F),
                               hn::Set(d, 0.5F - 0.5F * splat::kTile));
    V low = hn::Set(d, static_cast<float>(splat::kTile));
    V high = hn::Set(d, -1.0F);
    for (const float next : {0.0F, 1.0F}) {
      const V y = hn::Add(first, hn::Set(d, next));
      const V w = hn::MulAdd(hn::Set(d, l22), y, hn::Set(d, w0));
      const V rest = hn::NegMulAdd(w, w, limit);
      const V half = hn::Sqrt(hn::Max(rest, zero));
      const V u = hn::MulAdd(hn::Set(d, l21), y, hn::Set(d, u0));
      // Pixel i is at X = i − 7.5.
      const V shift = hn::Set(d, 0.5F * splat::kTile - 0.5F);
      const V begin =
          hn::Sub(hn::MulAdd(hn::Neg(hn::Add(u, half)), inverse, shift), hn::Set(d, kSlack));
      const V end = hn::Add(hn::MulAdd(hn::Sub(half, u), inverse, shift), hn::Set(d, kSlack));
      const V from = hn::Max(hn::Ceil(begin), zero);
      const V to = hn::Min(hn::Floor(end), hn::Set(d, static_cast<float>(splat::kTile - 1)));
      const auto some = hn::And(hn::Ge(rest, zero), hn::Le(from, to));
      low = hn::IfThenElse(some, hn::Min(low, from), low);
      high = hn::IfThenElse(some, hn::Max(high, to), high);
    }
    // Columns of patches; those of an empty row leave no bit: low 16 shifts all of them out.
    const V per_patch = hn::Set(d, 1.0F / static_cast<float>(kPatchWidth));
    const auto a = hn::ConvertTo(di, hn::Floor(hn::Mul(low, per_patch)));
    const auto b = hn::ConvertTo(di, hn::Floor(hn::Mul(high, per_patch)));
    const auto columns = hn::Set(di, static_cast<std::int32_t>(kPatchColumns) - 1);
    const auto all = hn::Set(di, kAll);
    hn::Store(hn::And(hn::Shl(all, a), hn::Shr(all, hn::Sub(columns, b))), di, bits + i);
  }
  std::uint64_t patches = 0;
  for (std::size_t r = 0; r < kPatchRows; ++r) {
    patches |= static_cast<std::uint64_t>(bits[r]) << (r * kPatchColumns);
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
  out.pairs.clear();
  out.tiles.clear();
  const std::size_t tiles = frame.tiles();
  std::uint32_t* counts = frame.offsets.data() + chunk * tiles;
  std::fill(counts, counts + tiles, 0U);
  const std::size_t begin = chunk * splat::kChunk;
  const std::size_t end = std::min(begin + splat::kChunk, frame.order.size());
  for (std::size_t rank = begin; rank < end; ++rank) {
    const splat::Footprint& f = frame.footprints[frame.order[rank]];
    splat::Shade& shade = frame.shades[rank];
    shade = {static_cast<float>(f.l11),
             static_cast<float>(f.l21),
             static_cast<float>(f.l22),
             f.log2_opacity,
             {f.colour[0], f.colour[1], f.colour[2]},
             f.depth};
    frame.first_slot[rank] = static_cast<std::uint32_t>(out.pairs.size());
    int x0 = 0;
    int x1 = -1;
    int y0 = 0;
    int y1 = -1;
    if (!tile_range(f.mean[0], f.half[0], frame.tiles_x, x0, x1) ||
        !tile_range(f.mean[1], f.half[1], frame.tiles_y, y0, y1)) {
      continue;
    }
    const float e = f.log2_opacity - static_cast<float>(splat::kSmallestLog2);
    for (int ty = y0; ty <= y1; ++ty) {
      for (int tx = x0; tx <= x1; ++tx) {
        const double dx = (tx + 0.5) * splat::kTile - f.mean[0];
        const double dy = (ty + 0.5) * splat::kTile - f.mean[1];
        const auto u0 = static_cast<float>(f.l11 * dx + f.l21 * dy);
        const auto w0 = static_cast<float>(f.l22 * dy);
        const std::uint64_t patches = patches_of(u0, w0, shade.l11, shade.l21, shade.l22, e);
        if (patches == 0) continue;
        const auto tile = static_cast<std::uint32_t>(ty * frame.tiles_x + tx);
        const auto slot = static_cast<std::uint32_t>(out.pairs.size());
        out.pairs.push_back({patches, static_cast<std::uint32_t>(rank), slot, u0, w0});
        out.tiles.push_back(tile);
        ++counts[tile];
      }
    }
  }
}

/// 2^e to 1e-7 for e in [−126, 1].
HWY_INLINE FloatVector exp2_small(FloatVector e) {
  const FloatTag d;
  const hn::RebindToSigned<FloatTag> di;
  // Adding 1.5·2²³ rounds to an integer and leaves it in the low bits.
  const auto magic = hn::Set(d, 12582912.0F);
  const auto rounded = hn::Add(e, magic);
  const auto f = hn::Sub(e, hn::Sub(rounded, magic));
  // Minimax on [−½, ½] in relative error, 7.5e-8.
  auto p = hn::Set(d, 0.001327646862678289F);
  p = hn::MulAdd(p, f, hn::Set(d, 0.009675541353775817F));
  p = hn::MulAdd(p, f, hn::Set(d, 0.055507132890633804F));
  p = hn::MulAdd(p, f, hn::Set(d, 0.24022119726642246F));
  p = hn::MulAdd(p, f, hn::Set(d, 0.6931469670497241F));
  p = hn::MulAdd(p, f, hn::Set(d, 1.0000000716507331F));
  const auto exponent = hn::ShiftLeft<23>(hn::BitCast(di, rounded));
  return hn::BitCast(d, hn::Add(hn::BitCast(di, p), exponent));
}

/// Transmittance of a tile's pixels before the first Gaussian, 0 outside the image; bits of the
/// patches that lie in it.
inline std::uint64_t start_tile(const splat::Frame& frame, std::size_t tile, float* transmittance) {
  const TileMap& map = tile_map();
  const int width = frame.view.width - static_cast<int>(tile) % frame.tiles_x * splat::kTile;
  const int height = frame.view.height - static_cast<int>(tile) / frame.tiles_x * splat::kTile;
  if (width >= splat::kTile && height >= splat::kTile) {
    std::fill_n(transmittance, splat::kTilePixels, 1.0F);
    return ~std::uint64_t{0} >> (64 - kPatches);
  }
  std::uint64_t alive = 0;
  for (std::size_t i = 0; i < splat::kTilePixels; ++i) {
    const bool inside = map.column[i] < width && map.row[i] < height;
    transmittance[i] = inside ? 1.0F : 0.0F;
    if (inside) alive |= std::uint64_t{1} << (i / kPatch);
  }
  return alive;
}

/// Calls run(place in the tile's memory, place in the image, count) for runs of pixels that lie
/// side by side in both; nearly all are as long as a patch is wide, which is then known to the
/// compiler.
template <class Run>
HWY_INLINE void for_runs(const splat::Frame& frame, std::size_t tile, const Run& run) {
  const auto width = static_cast<std::size_t>(frame.view.width);
  const std::size_t x0 = tile % static_cast<std::size_t>(frame.tiles_x) * splat::kTile;
  const std::size_t y0 = tile / static_cast<std::size_t>(frame.tiles_x) * splat::kTile;
  const std::size_t rows =
      std::min<std::size_t>(splat::kTile, static_cast<std::size_t>(frame.view.height) - y0);
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < kPatchColumns; ++column) {
      const std::size_t x = x0 + column * kPatchWidth;
      if (x >= width) break;
      const std::size_t place = (row / 2 * kPatchColumns + column) * kPatch + row % 2 * kPatchWidth;
      const std::size_t pixel = (y0 + row) * width + x;
      if (x + kPatchWidth <= width) {
        run(place, pixel, std::integral_constant<std::size_t, kPatchWidth>());
      } else {
        run(place, pixel, width - x);
      }
    }
  }
}

inline void render_tile(splat::Frame& frame, std::size_t tile) {
  const FloatTag d;
  const TileMap& map = tile_map();
  alignas(64) float transmittance[splat::kTilePixels];
  alignas(64) float channels[4][splat::kTilePixels] = {};
  std::uint64_t alive = start_tile(frame, tile, transmittance);
  const FloatVector smallest = hn::Set(d, static_cast<float>(splat::kSmallestLog2));
  const FloatVector largest = hn::Set(d, static_cast<float>(splat::kLargestAlpha));
  const FloatVector stop = hn::Set(d, static_cast<float>(splat::kSmallestTransmittance));
  const splat::Pair* pair = frame.pairs.data() + frame.tile_begin[tile];
  const splat::Pair* const end = frame.pairs.data() + frame.tile_begin[tile + 1];
  for (; pair != end && alive != 0; ++pair) {
    std::uint64_t patches = pair->patches & alive;
    const splat::Shade& shade = frame.shades[pair->rank];
    const FloatVector u0 = hn::Set(d, pair->u0);
    const FloatVector w0 = hn::Set(d, pair->w0);
    const FloatVector l11 = hn::Set(d, shade.l11);
    const FloatVector l21 = hn::Set(d, shade.l21);
    const FloatVector l22 = hn::Set(d, shade.l22);
    const FloatVector opacity = hn::Set(d, shade.log2_opacity);
    while (patches != 0) {
      const auto patch = static_cast<std::size_t>(std::countr_zero(patches));
      patches &= patches - 1;
      const std::size_t i = patch * kPatch;
      const FloatVector y = hn::Load(d, map.y + i);
      const FloatVector t = hn::Load(d, transmittance + i);
      const FloatVector u = hn::MulAdd(l11, hn::Load(d, map.x + i), hn::MulAdd(l21, y, u0));
      const FloatVector w = hn::MulAdd(l22, y, w0);
      const FloatVector e = hn::NegMulAdd(w, w, hn::NegMulAdd(u, u, opacity));
      const auto active = hn::And(hn::Ge(e, smallest), hn::Ge(t, stop));
      const FloatVector alpha =
          hn::IfThenElseZero(active, hn::Min(exp2_small(hn::Max(e, smallest)), largest));
      const FloatVector weight = hn::Mul(alpha, t);
      const FloatVector after = hn::NegMulAdd(alpha, t, t);
      hn::Store(after, d, transmittance + i);
      for (std::size_t c = 0; c < 3; ++c) {
        hn::Store(hn::MulAdd(weight, hn::Set(d, shade.colour[c]), hn::Load(d, channels[c] + i)), d,
                  channels[c] + i);
      }
      hn::Store(hn::MulAdd(weight, hn::Set(d, shade.depth), hn::Load(d, channels[3] + i)), d,
                channels[3] + i);
      if (HWY_UNLIKELY(hn::AllFalse(d, hn::Ge(after, stop)))) alive &= ~(std::uint64_t{1} << patch);
    }
  }
  const std::size_t pixels = frame.image.pixels();
  float* const colour = frame.image.colour.data();
  float* const mask = frame.image.mask.data();
  float* const depth = frame.image.depth.data();
  for_runs(frame, tile, [&](std::size_t i, std::size_t pixel, auto count) {
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t k = 0; k < count; ++k) colour[c * pixels + pixel + k] = channels[c][i + k];
    }
    for (std::size_t k = 0; k < count; ++k) mask[pixel + k] = 1.0F - transmittance[i + k];
    for (std::size_t k = 0; k < count; ++k) depth[pixel + k] = channels[3][i + k];
  });
}

inline void differentiate_tile(splat::Frame& frame, std::size_t tile) {
  if (frame.tile_begin[tile] == frame.tile_begin[tile + 1]) return;
  const FloatTag d;
  const TileMap& map = tile_map();
  alignas(64) float transmittance[splat::kTilePixels];
  // Derivatives of the loss in colour, depth and mask, and Q = dL · (what is still behind).
  alignas(64) float loss[5][splat::kTilePixels] = {};
  alignas(64) float behind[splat::kTilePixels] = {};
  std::uint64_t alive = start_tile(frame, tile, transmittance);
  const std::size_t pixels = frame.image.pixels();
  const float* const loss_from[5] = {frame.loss->colour.data(), frame.loss->colour.data() + pixels,
                                     frame.loss->colour.data() + 2 * pixels,
                                     frame.loss->depth.data(), frame.loss->mask.data()};
  const float* const image_from[5] = {frame.image.colour.data(), frame.image.colour.data() + pixels,
                                      frame.image.colour.data() + 2 * pixels,
                                      frame.image.depth.data(), frame.image.mask.data()};
  for_runs(frame, tile, [&](std::size_t i, std::size_t pixel, auto count) {
    for (std::size_t c = 0; c < 5; ++c) {
      for (std::size_t k = 0; k < count; ++k) {
        loss[c][i + k] = loss_from[c][pixel + k];
        behind[i + k] += loss[c][i + k] * image_from[c][pixel + k];
      }
    }
  });
  const FloatVector smallest = hn::Set(d, static_cast<float>(splat::kSmallestLog2));
  const FloatVector largest = hn::Set(d, static_cast<float>(splat::kLargestAlpha));
  const FloatVector stop = hn::Set(d, static_cast<float>(splat::kSmallestTransmittance));
  const FloatVector one = hn::Set(d, 1.0F);
  const splat::Pair* pair = frame.pairs.data() + frame.tile_begin[tile];
  const splat::Pair* const end = frame.pairs.data() + frame.tile_begin[tile + 1];
  for (; pair != end && alive != 0; ++pair) {
    std::uint64_t patches = pair->patches & alive;
    const splat::Shade& shade = frame.shades[pair->rank];
    const FloatVector u0 = hn::Set(d, pair->u0);
    const FloatVector w0 = hn::Set(d, pair->w0);
    const FloatVector l11 = hn::Set(d, shade.l11);
    const FloatVector l21 = hn::Set(d, shade.l21);
    const FloatVector l22 = hn::Set(d, shade.l22);
    const FloatVector opacity = hn::Set(d, shade.log2_opacity);
    FloatVector s0 = hn::Zero(d);
    FloatVector su = s0;
    FloatVector sw = s0;
    FloatVector suu = s0;
    FloatVector suw = s0;
    FloatVector sww = s0;
    FloatVector red = s0;
    FloatVector green = s0;
    FloatVector blue = s0;
    FloatVector depth = s0;
    while (patches != 0) {
      const auto patch = static_cast<std::size_t>(std::countr_zero(patches));
      patches &= patches - 1;
      const std::size_t i = patch * kPatch;
      // The same as in render_tile, to the bit.
      const FloatVector y = hn::Load(d, map.y + i);
      const FloatVector t = hn::Load(d, transmittance + i);
      const FloatVector u = hn::MulAdd(l11, hn::Load(d, map.x + i), hn::MulAdd(l21, y, u0));
      const FloatVector w = hn::MulAdd(l22, y, w0);
      const FloatVector e = hn::NegMulAdd(w, w, hn::NegMulAdd(u, u, opacity));
      const auto active = hn::And(hn::Ge(e, smallest), hn::Ge(t, stop));
      const FloatVector exact = exp2_small(hn::Max(e, smallest));
      const FloatVector alpha = hn::IfThenElseZero(active, hn::Min(exact, largest));
      const FloatVector weight = hn::Mul(alpha, t);
      const FloatVector after = hn::NegMulAdd(alpha, t, t);
      hn::Store(after, d, transmittance + i);

      const FloatVector l_red = hn::Load(d, loss[0] + i);
      const FloatVector l_green = hn::Load(d, loss[1] + i);
      const FloatVector l_blue = hn::Load(d, loss[2] + i);
      const FloatVector l_depth = hn::Load(d, loss[3] + i);
      red = hn::MulAdd(weight, l_red, red);
      green = hn::MulAdd(weight, l_green, green);
      blue = hn::MulAdd(weight, l_blue, blue);
      depth = hn::MulAdd(weight, l_depth, depth);
      FloatVector g = hn::MulAdd(l_red, hn::Set(d, shade.colour[0]), hn::Load(d, loss[4] + i));
      g = hn::MulAdd(l_green, hn::Set(d, shade.colour[1]), g);
      g = hn::MulAdd(l_blue, hn::Set(d, shade.colour[2]), g);
      g = hn::MulAdd(l_depth, hn::Set(d, shade.depth), g);
      const FloatVector rest = hn::NegMulAdd(weight, g, hn::Load(d, behind + i));
      hn::Store(rest, d, behind + i);
      // ∂L/∂ln α = α (T g − Q/(1 − α)); none where α is clamped.
      const FloatVector hidden = hn::Div(hn::Mul(alpha, rest), hn::Sub(one, alpha));
      const FloatVector v =
          hn::IfThenElseZero(hn::Lt(exact, largest), hn::MulSub(weight, g, hidden));
      const FloatVector vu = hn::Mul(v, u);
      const FloatVector vw = hn::Mul(v, w);
      s0 = hn::Add(s0, v);
      su = hn::Add(su, vu);
      sw = hn::Add(sw, vw);
      suu = hn::MulAdd(vu, u, suu);
      suw = hn::MulAdd(vu, w, suw);
      sww = hn::MulAdd(vw, w, sww);
      if (HWY_UNLIKELY(hn::AllFalse(d, hn::Ge(after, stop)))) alive &= ~(std::uint64_t{1} << patch);
    }
    splat::Slot& slot = frame.slots[pair->slot];
    const FloatVector sums[splat::kSums] = {s0, su, sw, suu, suw, sww, red, green, blue, depth};
    for (std::size_t k = 0; k < splat::kSums; ++k)
      slot.sum[k] = hn::GetLane(hn::SumOfLanes(d, sums[k]));
  }
  for (; pair != end; ++pair) frame.slots[pair->slot] = {};
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
