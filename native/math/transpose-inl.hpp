// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers that lie one after another of each of a few things, to each number of one after another.
// Included once per SIMD target.
#if defined(MATTERFIT_MATH_TRANSPOSE_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATH_TRANSPOSE_INL_HPP
#undef MATTERFIT_MATH_TRANSPOSE_INL_HPP
#else
#define MATTERFIT_MATH_TRANSPOSE_INL_HPP
#endif

#include "math/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// to[n][m] = from[m][n]ᵀ, at most 4 × 4 numbers, rows so many numbers apart.
template <std::size_t m, std::size_t n, class S>
HWY_INLINE void transpose(const S* from, std::size_t from_row, S* to, std::size_t to_row) {
  if constexpr (m == 4 && n == 4 && sizeof(S) == 4) {
    const hn::FixedTag<S, 4> d;
    const auto a = hn::LoadU(d, from);
    const auto b = hn::LoadU(d, from + from_row);
    const auto c = hn::LoadU(d, from + 2 * from_row);
    const auto e = hn::LoadU(d, from + 3 * from_row);
    const auto ac_low = hn::InterleaveLower(d, a, c);
    const auto be_low = hn::InterleaveLower(d, b, e);
    const auto ac_high = hn::InterleaveUpper(d, a, c);
    const auto be_high = hn::InterleaveUpper(d, b, e);
    hn::StoreU(hn::InterleaveLower(d, ac_low, be_low), d, to);
    hn::StoreU(hn::InterleaveUpper(d, ac_low, be_low), d, to + to_row);
    hn::StoreU(hn::InterleaveLower(d, ac_high, be_high), d, to + 2 * to_row);
    hn::StoreU(hn::InterleaveUpper(d, ac_high, be_high), d, to + 3 * to_row);
  } else {
    for (std::size_t i = 0; i < m; ++i)
      for (std::size_t j = 0; j < n; ++j) to[j * to_row + i] = from[i * from_row + j];
  }
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
