// SPDX-License-Identifier: GPL-3.0-or-later
// Pairs of Gaussians and tiles, forward and backward. Included once per SIMD target.
#if defined(MATTERFIT_SPLAT_TILE_KERNEL_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_SPLAT_TILE_KERNEL_INL_HPP
#undef MATTERFIT_SPLAT_TILE_KERNEL_INL_HPP
#else
#define MATTERFIT_SPLAT_TILE_KERNEL_INL_HPP
#endif

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <initializer_list>
#include <type_traits>

#include "splat/tile_pairs-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// A tile's numbers, patch by patch, so that all channels of a patch lie together.
template <std::size_t Channels>
struct TileState {
  alignas(64) float values[kPatches][Channels][kPatch];

  HWY_INLINE float* patch(std::size_t at) { return values[at][0]; }
  /// A channel of the pixel at a place of the tile's memory.
  HWY_INLINE float* at(std::size_t channel, std::size_t place) {
    return values[place / kPatch][channel] + place % kPatch;
  }
};

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
template <class Start>
HWY_INLINE std::uint64_t start_tile(const splat::Frame& frame, std::size_t tile, const Start& set) {
  const TileMap& map = tile_map();
  const int width = frame.view.width - static_cast<int>(tile) % frame.tiles_x * splat::kTile;
  const int height = frame.view.height - static_cast<int>(tile) / frame.tiles_x * splat::kTile;
  if (width >= splat::kTile && height >= splat::kTile) {
    for (std::size_t i = 0; i < splat::kTilePixels; ++i) set(i, 1.0F);
    return ~std::uint64_t{0} >> (64 - kPatches);
  }
  std::uint64_t alive = 0;
  for (std::size_t i = 0; i < splat::kTilePixels; ++i) {
    const bool inside = map.column[i] < width && map.row[i] < height;
    set(i, inside ? 1.0F : 0.0F);
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

/// A pair's numbers, as each pixel of a patch needs them.
struct PairNumbers {
  alignas(64) float l11;
  float l21;
  float l22;
  float log2_opacity;
  float colour[3];
  float depth;
  float u0;
  float w0;
};
static_assert(sizeof(splat::Shade) == offsetof(PairNumbers, u0));

/// Pairs of a tile's list that are taken at a time, and the most patches that they touch. All their
/// opacities are made before any pixel is drawn: so many do not depend on each other, which hides
/// how long each takes.
inline constexpr std::size_t kBatch = 8;
inline constexpr std::size_t kVisits = kBatch * kPatches;

/// Pairs at patches, in the order of the list.
struct Batch {
  PairNumbers pairs[kBatch];
  std::uint32_t begin[kBatch + 1];           ///< where each pair's visits begin
  std::uint32_t visits[kVisits + 16];        ///< pair · kPatches + patch, and room for a register
  alignas(64) float alpha[kVisits][kPatch];  ///< as if nothing were in front

  [[nodiscard]] HWY_INLINE std::size_t patch(std::size_t visit) const {
    return visits[visit] % kPatches;
  }
  [[nodiscard]] HWY_INLINE const PairNumbers& pair(std::size_t visit) const {
    return pairs[visits[visit] >> kPatchesLog2];
  }
};

/// u and w of a pair at the patch whose pixels begin at a place.
HWY_INLINE FloatVector u_at(const PairNumbers& pair, const TileMap& map, std::size_t place) {
  const FloatTag d;
  return hn::MulAdd(
      hn::Set(d, pair.l11), hn::Load(d, map.x + place),
      hn::MulAdd(hn::Set(d, pair.l21), hn::Load(d, map.y + place), hn::Set(d, pair.u0)));
}

HWY_INLINE FloatVector w_at(const PairNumbers& pair, const TileMap& map, std::size_t place) {
  const FloatTag d;
  return hn::MulAdd(hn::Set(d, pair.l22), hn::Load(d, map.y + place), hn::Set(d, pair.w0));
}

/// Fills a batch from the `left` pairs at `pair`, at the patches that are alive.
HWY_INLINE void fill_batch(const splat::Frame& frame, const splat::Pair* pair, std::size_t left,
                           std::uint64_t alive, Batch& batch) {
  const hn::CappedTag<std::uint32_t, 16> ids;
  std::uint32_t size = 0;
  const std::size_t pairs = std::min(kBatch, left);
  for (std::size_t k = 0; k < pairs; ++k) {
    // Shades lie anywhere: those of a later batch are asked for now.
    if (k + 2 * kBatch < left) hwy::Prefetch(&frame.shades[pair[k + 2 * kBatch].rank]);
    std::memcpy(&batch.pairs[k], &frame.shades[pair[k].rank], sizeof(splat::Shade));
    batch.pairs[k].u0 = pair[k].u0;
    batch.pairs[k].w0 = pair[k].w0;
    batch.begin[k] = size;
    const std::uint64_t patches = pair[k].patches & alive;
    for (std::size_t i = 0; i < kPatches; i += hn::Lanes(ids)) {
      const std::uint64_t part = patches >> i & ((std::uint64_t{1} << hn::Lanes(ids)) - 1);
      std::uint8_t bits[sizeof(part)];
      std::memcpy(bits, &part, sizeof(part));
      const auto at = hn::Add(hn::Iota(ids, static_cast<std::uint32_t>(i)),
                              hn::Set(ids, static_cast<std::uint32_t>(k * kPatches)));
      size += static_cast<std::uint32_t>(hn::CompressBitsStore(at, bits, ids, batch.visits + size));
    }
  }
  for (std::size_t k = pairs; k <= kBatch; ++k) batch.begin[k] = size;

  const FloatTag d;
  const TileMap& map = tile_map();
  const FloatVector smallest = hn::Set(d, static_cast<float>(splat::kSmallestLog2));
  const FloatVector largest = hn::Set(d, static_cast<float>(splat::kLargestAlpha));
  for (std::size_t v = 0; v < size; ++v) {
    const PairNumbers& p = batch.pair(v);
    const std::size_t place = batch.patch(v) * kPatch;
    const FloatVector u = u_at(p, map, place);
    const FloatVector w = w_at(p, map, place);
    const FloatVector e = hn::NegMulAdd(w, w, hn::NegMulAdd(u, u, hn::Set(d, p.log2_opacity)));
    hn::Store(
        hn::IfThenElseZero(hn::Ge(e, smallest), hn::Min(exp2_small(hn::Max(e, smallest)), largest)),
        d, batch.alpha[v]);
  }
}

/// Copies a run of for_runs.
template <class Count>
HWY_INLINE void copy_run(const float* from, float* to, Count count) {
  if constexpr (std::is_same_v<Count, std::size_t>) {
    std::copy_n(from, count, to);
  } else {
    const hn::CappedTag<float, kPatchWidth> d;
    for (std::size_t k = 0; k < kPatchWidth; k += hn::Lanes(d)) {
      hn::StoreU(hn::LoadU(d, from + k), d, to + k);
    }
  }
}

/// to += a · b over a run of for_runs.
template <class Count>
HWY_INLINE void add_products(const float* a, const float* b, float* to, Count count) {
  if constexpr (std::is_same_v<Count, std::size_t>) {
    for (std::size_t k = 0; k < count; ++k) to[k] += a[k] * b[k];
  } else {
    const hn::CappedTag<float, kPatchWidth> d;
    for (std::size_t k = 0; k < kPatchWidth; k += hn::Lanes(d)) {
      hn::StoreU(hn::MulAdd(hn::LoadU(d, a + k), hn::LoadU(d, b + k), hn::LoadU(d, to + k)), d,
                 to + k);
    }
  }
}

/// Asks for a tile's pixels of some channels, row by row.
HWY_INLINE void ask_for(const splat::Frame& frame, std::size_t tile,
                        std::initializer_list<const float*> channels) {
  const auto width = static_cast<std::size_t>(frame.view.width);
  const std::size_t x = tile % static_cast<std::size_t>(frame.tiles_x) * splat::kTile;
  const std::size_t y = tile / static_cast<std::size_t>(frame.tiles_x) * splat::kTile;
  const std::size_t rows =
      std::min<std::size_t>(splat::kTile, static_cast<std::size_t>(frame.view.height) - y);
  for (const float* channel : channels) {
    for (std::size_t row = 0; row < rows; ++row) hwy::Prefetch(channel + (y + row) * width + x);
  }
}

inline void render_tile(splat::Frame& frame, std::size_t tile) {
  const FloatTag d;
  const std::size_t pixels = frame.image.pixels();
  float* const out[5] = {frame.image.colour.data(), frame.image.colour.data() + pixels,
                         frame.image.colour.data() + 2 * pixels, frame.image.depth.data(),
                         frame.image.mask.data()};
  const splat::Pair* pair = frame.pairs.data() + frame.tile_begin[tile];
  const splat::Pair* const end = frame.pairs.data() + frame.tile_begin[tile + 1];
  if (pair == end) {
    if (frame.blank[tile] != 0) return;
    frame.blank[tile] = 1;
    for_runs(frame, tile, [&](std::size_t, std::size_t pixel, auto count) {
      for (float* channel : out) std::fill_n(channel + pixel, std::size_t{count}, 0.0F);
    });
    return;
  }
  frame.blank[tile] = 0;
  ask_for(frame, tile, {out[0], out[1], out[2], out[3], out[4]});
  // Colour, depth, transmittance.
  TileState<5> state{};
  std::uint64_t alive =
      start_tile(frame, tile, [&](std::size_t i, float value) { *state.at(4, i) = value; });
  const FloatVector stop = hn::Set(d, static_cast<float>(splat::kSmallestTransmittance));
  Batch batch;
  for (auto left = static_cast<std::size_t>(end - pair); left > 0 && alive != 0;
       left -= std::min(kBatch, left)) {
    fill_batch(frame, end - left, left, alive, batch);
    for (std::size_t v = 0; v < batch.begin[kBatch]; ++v) {
      const std::size_t patch = batch.patch(v);
      const PairNumbers& p = batch.pair(v);
      float* const own = state.patch(patch);
      const FloatVector t = hn::Load(d, own + 4 * kPatch);
      const FloatVector alpha = hn::IfThenElseZero(hn::Ge(t, stop), hn::Load(d, batch.alpha[v]));
      const FloatVector weight = hn::Mul(alpha, t);
      const FloatVector after = hn::NegMulAdd(alpha, t, t);
      hn::Store(after, d, own + 4 * kPatch);
      for (std::size_t c = 0; c < 4; ++c) {
        const FloatVector value = hn::Set(d, c < 3 ? p.colour[c] : p.depth);
        hn::Store(hn::MulAdd(weight, value, hn::Load(d, own + c * kPatch)), d, own + c * kPatch);
      }
      if (HWY_UNLIKELY(hn::AllFalse(d, hn::Ge(after, stop)))) alive &= ~(std::uint64_t{1} << patch);
    }
  }
  for (std::size_t patch = 0; patch < kPatches; ++patch) {
    float* const t = state.patch(patch) + 4 * kPatch;
    hn::Store(hn::Sub(hn::Set(d, 1.0F), hn::Load(d, t)), d, t);
  }
  for_runs(frame, tile, [&](std::size_t i, std::size_t pixel, auto count) {
    for (std::size_t c = 0; c < 5; ++c) copy_run(state.at(c, i), out[c] + pixel, count);
  });
}

/// Four registers into one whose blocks hold their blocks' sums.
HWY_INLINE FloatVector sum_blocks(FloatVector a, FloatVector b, FloatVector c, FloatVector e) {
  const FloatTag d;
  const hn::Repartition<double, FloatTag> dd;
  const FloatVector ab = hn::Add(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b));
  const FloatVector ce = hn::Add(hn::InterleaveLower(d, c, e), hn::InterleaveUpper(d, c, e));
  const auto low = hn::InterleaveLower(dd, hn::BitCast(dd, ab), hn::BitCast(dd, ce));
  const auto high = hn::InterleaveUpper(dd, hn::BitCast(dd, ab), hn::BitCast(dd, ce));
  return hn::Add(hn::BitCast(d, low), hn::BitCast(d, high));
}

/// The sum of a register's blocks of four lanes.
template <class D>
HWY_INLINE hn::Vec<hn::CappedTag<float, 4>> over_blocks(D d, hn::Vec<D> v) {
  if constexpr (hn::MaxLanes(d) <= 4) {
    return v;
  } else {
    const hn::Half<D> half;
    return over_blocks(half, hn::Add(hn::LowerHalf(half, v), hn::UpperHalf(half, v)));
  }
}

inline void differentiate_tile(splat::Frame& frame, std::size_t tile) {
  if (frame.tile_begin[tile] == frame.tile_begin[tile + 1]) return;
  const FloatTag d;
  const TileMap& map = tile_map();
  // Derivatives of the loss in colour, depth and mask, transmittance, and Q = dL · (what is still
  // behind).
  TileState<7> state{};
  std::uint64_t alive =
      start_tile(frame, tile, [&](std::size_t i, float value) { *state.at(5, i) = value; });
  const std::size_t pixels = frame.image.pixels();
  const float* const loss_from[5] = {frame.loss->colour.data(), frame.loss->colour.data() + pixels,
                                     frame.loss->colour.data() + 2 * pixels,
                                     frame.loss->depth.data(), frame.loss->mask.data()};
  const float* const image_from[5] = {frame.image.colour.data(), frame.image.colour.data() + pixels,
                                      frame.image.colour.data() + 2 * pixels,
                                      frame.image.depth.data(), frame.image.mask.data()};
  if (tile + 1 < frame.tiles()) {
    ask_for(frame, tile + 1,
            {loss_from[0], loss_from[1], loss_from[2], loss_from[3], loss_from[4], image_from[0],
             image_from[1], image_from[2], image_from[3], image_from[4]});
  }
  for_runs(frame, tile, [&](std::size_t i, std::size_t pixel, auto count) {
    for (std::size_t c = 0; c < 5; ++c) {
      copy_run(loss_from[c] + pixel, state.at(c, i), count);
      add_products(loss_from[c] + pixel, image_from[c] + pixel, state.at(6, i), count);
    }
  });
  const FloatVector largest = hn::Set(d, static_cast<float>(splat::kLargestAlpha));
  const FloatVector stop = hn::Set(d, static_cast<float>(splat::kSmallestTransmittance));
  const FloatVector one = hn::Set(d, 1.0F);
  const splat::Pair* pair = frame.pairs.data() + frame.tile_begin[tile];
  const splat::Pair* const end = frame.pairs.data() + frame.tile_begin[tile + 1];
  Batch batch;
  for (std::size_t k = kBatch; pair != end; ++pair, ++k) {
    if (k == kBatch) {
      if (alive == 0) break;
      k = 0;
      fill_batch(frame, pair, static_cast<std::size_t>(end - pair), alive, batch);
    }
    const PairNumbers& p = batch.pairs[k];
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
    for (std::size_t visit = batch.begin[k]; visit < batch.begin[k + 1]; ++visit) {
      const std::size_t patch = batch.patch(visit);
      float* const own = state.patch(patch);
      const FloatVector u = u_at(p, map, patch * kPatch);
      const FloatVector w = w_at(p, map, patch * kPatch);
      // The same as in render_tile, to the bit.
      const FloatVector t = hn::Load(d, own + 5 * kPatch);
      const FloatVector alpha =
          hn::IfThenElseZero(hn::Ge(t, stop), hn::Load(d, batch.alpha[visit]));
      const FloatVector weight = hn::Mul(alpha, t);
      const FloatVector after = hn::NegMulAdd(alpha, t, t);
      hn::Store(after, d, own + 5 * kPatch);

      const FloatVector l_red = hn::Load(d, own);
      const FloatVector l_green = hn::Load(d, own + kPatch);
      const FloatVector l_blue = hn::Load(d, own + 2 * kPatch);
      const FloatVector l_depth = hn::Load(d, own + 3 * kPatch);
      red = hn::MulAdd(weight, l_red, red);
      green = hn::MulAdd(weight, l_green, green);
      blue = hn::MulAdd(weight, l_blue, blue);
      depth = hn::MulAdd(weight, l_depth, depth);
      FloatVector g = hn::MulAdd(l_red, hn::Set(d, p.colour[0]), hn::Load(d, own + 4 * kPatch));
      g = hn::MulAdd(l_green, hn::Set(d, p.colour[1]), g);
      g = hn::MulAdd(l_blue, hn::Set(d, p.colour[2]), g);
      g = hn::MulAdd(l_depth, hn::Set(d, p.depth), g);
      const FloatVector rest = hn::NegMulAdd(weight, g, hn::Load(d, own + 6 * kPatch));
      hn::Store(rest, d, own + 6 * kPatch);
      // ∂L/∂ln α = α (T g − Q/(1 − α)); none where α is clamped.
      const FloatVector clear = hn::Sub(one, alpha);
      const FloatVector guess = hn::ApproximateReciprocal(clear);
      const FloatVector inverse = hn::Mul(guess, hn::NegMulAdd(clear, guess, hn::Set(d, 2.0F)));
      const FloatVector hidden = hn::Mul(hn::Mul(alpha, rest), inverse);
      const FloatVector v =
          hn::IfThenElseZero(hn::Lt(alpha, largest), hn::MulSub(weight, g, hidden));
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
    const hn::CappedTag<float, 4> block;
    hn::StoreU(over_blocks(d, sum_blocks(s0, su, sw, suu)), block, slot.sum);
    hn::StoreU(over_blocks(d, sum_blocks(suw, sww, red, green)), block, slot.sum + 4);
    hn::StoreU(over_blocks(d, sum_blocks(blue, depth, hn::Zero(d), hn::Zero(d))), block,
               slot.sum + 8);
  }
  for (; pair != end; ++pair) frame.slots[pair->slot] = {};
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
