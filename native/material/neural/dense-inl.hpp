// SPDX-License-Identifier: GPL-3.0-or-later
// Products of small dense matrices with a panel: kPanelRegisters registers of points side by side,
// one row a feature, so that a row of weights is broadcast and a column of points stays in
// registers. Included once per SIMD target.
#if defined(MATTERFIT_MATERIAL_NEURAL_DENSE_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_NEURAL_DENSE_INL_HPP
#undef MATTERFIT_MATERIAL_NEURAL_DENSE_INL_HPP
#else
#define MATTERFIT_MATERIAL_NEURAL_DENSE_INL_HPP
#endif

#include <cstddef>
#include <type_traits>

#include "math/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Registers of a panel. Six rows of them are summed at once: 24 of AVX-512's 32 registers, 12 of
/// the 16 elsewhere.
template <class T>
inline constexpr int kPanelRegisters = LaneTraits<T>::kCount >= 16 ? 4 : 2;
/// Points of a panel.
template <class T>
inline constexpr std::size_t kPanel = kPanelRegisters<T>* LaneTraits<T>::kCount;

inline constexpr int kTileRows = 6;

/// A matrix read entry by entry: (r, k) at data[r · row + k · column].
template <class S>
struct MatrixView {
  const S* data;
  std::size_t row;
  std::size_t column;
};

/// out = A x for `kRows` rows of A; x has `depth` rows of kPanel<T>.
template <class T, int kRows, class S = typename LaneTraits<T>::Scalar>
HWY_INLINE void dense_tile(const MatrixView<S>& a, std::size_t depth, const S* HWY_RESTRICT x,
                           S* HWY_RESTRICT out) {
  constexpr int kRegs = kPanelRegisters<T>;
  constexpr std::size_t kCount = LaneTraits<T>::kCount;
  T sum[kRows][kRegs];
#pragma GCC unroll 8
  for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 4
    for (int g = 0; g < kRegs; ++g) sum[r][g] = T(S(0));
  }
  for (std::size_t k = 0; k < depth; ++k) {
    T in[kRegs];
#pragma GCC unroll 4
    for (int g = 0; g < kRegs; ++g) in[g] = LaneTraits<T>::load(x + k * kPanel<T> + g * kCount);
#pragma GCC unroll 8
    for (int r = 0; r < kRows; ++r) {
      const T weight(a.data[r * a.row + k * a.column]);
#pragma GCC unroll 4
      for (int g = 0; g < kRegs; ++g) sum[r][g] = fma(weight, in[g], sum[r][g]);
    }
  }
#pragma GCC unroll 8
  for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 4
    for (int g = 0; g < kRegs; ++g) {
      LaneTraits<T>::store(sum[r][g], out + r * kPanel<T> + g * kCount);
    }
  }
}

/// out (`rows` of a panel) = A x.
template <class T, class S = typename LaneTraits<T>::Scalar>
void dense(const MatrixView<S>& a, std::size_t rows, std::size_t depth, const S* x, S* out) {
  const auto strip = [&](auto kRows, std::size_t r) {
    dense_tile<T, kRows()>({a.data + r * a.row, a.row, a.column}, depth, x, out + r * kPanel<T>);
  };
  std::size_t r = 0;
  for (; r + kTileRows <= rows; r += kTileRows) strip(std::integral_constant<int, kTileRows>(), r);
  for (; r + 4 <= rows; r += 4) strip(std::integral_constant<int, 4>(), r);
  for (; r + 3 <= rows; r += 3) strip(std::integral_constant<int, 3>(), r);
  for (; r < rows; ++r) strip(std::integral_constant<int, 1>(), r);
}

/// Sum over the lanes, in pairs.
HWY_INLINE float lanes_total(float value) { return value; }
HWY_INLINE double lanes_total(double value) { return value; }
template <class D>
HWY_INLINE typename Lanes<D>::Scalar lanes_total(Lanes<D> value) {
  return hn::GetLane(hn::SumOfLanes(D(), value.v));
}

/// sum(r, c) += Σ over points of y_r x_c, for kRows × kColumns entries of it; y and x are rows in
/// `panels` panels that lie `stride` scalars apart.
template <class T, int kRows, int kColumns, class S = typename LaneTraits<T>::Scalar>
HWY_INLINE void outer_tile(const S* HWY_RESTRICT y, const S* HWY_RESTRICT x, std::size_t panels,
                           std::size_t stride, S* HWY_RESTRICT sum, std::size_t row) {
  constexpr std::size_t kCount = LaneTraits<T>::kCount;
  T total[kRows][kColumns];
#pragma GCC unroll 4
  for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 4
    for (int c = 0; c < kColumns; ++c) total[r][c] = T(S(0));
  }
  for (std::size_t p = 0; p < panels; ++p, y += stride, x += stride) {
    for (std::size_t g = 0; g < kPanel<T>; g += kCount) {
      T left[kRows];
#pragma GCC unroll 4
      for (int r = 0; r < kRows; ++r) left[r] = LaneTraits<T>::load(y + r * kPanel<T> + g);
#pragma GCC unroll 4
      for (int c = 0; c < kColumns; ++c) {
        const T right = LaneTraits<T>::load(x + c * kPanel<T> + g);
#pragma GCC unroll 4
        for (int r = 0; r < kRows; ++r) total[r][c] = fma(left[r], right, total[r][c]);
      }
    }
  }
#pragma GCC unroll 4
  for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 4
    for (int c = 0; c < kColumns; ++c) sum[r * row + c] += lanes_total(total[r][c]);
  }
}

/// sum (`rows` × `columns`, row-major) += Σ over points of y xᵀ. Six registers of sums in two rows
/// and four in three: the remainder in columns goes one by one.
template <class T, class S = typename LaneTraits<T>::Scalar>
void outer(const S* y, std::size_t rows, const S* x, std::size_t columns, std::size_t panels,
           std::size_t stride, S* sum) {
  const auto strip = [&](auto kRows, std::size_t r) {
    std::size_t c = 0;
    for (; c + 4 <= columns; c += 4) {
      outer_tile<T, kRows(), 4>(y + r * kPanel<T>, x + c * kPanel<T>, panels, stride,
                                sum + r * columns + c, columns);
    }
    for (; c < columns; ++c) {
      outer_tile<T, kRows(), 1>(y + r * kPanel<T>, x + c * kPanel<T>, panels, stride,
                                sum + r * columns + c, columns);
    }
  };
  std::size_t r = 0;
  for (; r + 3 <= rows; r += 3) strip(std::integral_constant<int, 3>(), r);
  for (; r < rows; ++r) strip(std::integral_constant<int, 1>(), r);
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
