// SPDX-License-Identifier: GPL-3.0-or-later
// Points that lie one after another, into the registers of a panel and back. Included once per SIMD
// target.
#if defined(MATTERFIT_MATERIAL_NEURAL_POINT_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_NEURAL_POINT_LANES_INL_HPP
#undef MATTERFIT_MATERIAL_NEURAL_POINT_LANES_INL_HPP
#else
#define MATTERFIT_MATERIAL_NEURAL_POINT_LANES_INL_HPP
#endif

#include <algorithm>

#include "material/neural/dense-inl.hpp"
#include "math/mat3-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Rows of `kWidth` numbers from point `at` on, up to `end`, one register a column; lanes beyond
/// the end are 0.
template <std::size_t kWidth, class T, class S = typename LaneTraits<T>::Scalar>
HWY_INLINE void load_rows(const S* from, std::size_t at, std::size_t end,
                          T (&to)[kPanelRegisters<T>][kWidth]) {
  alignas(64) S lanes[kWidth][kPanel<T>] = {};
  const std::size_t count = std::min(end - at, kPanel<T>);
  for (std::size_t p = 0; p < count; ++p)
    for (std::size_t i = 0; i < kWidth; ++i) lanes[i][p] = from[kWidth * (at + p) + i];
  for (int g = 0; g < kPanelRegisters<T>; ++g)
    for (std::size_t i = 0; i < kWidth; ++i) {
      to[g][i] = LaneTraits<T>::load(lanes[i] + g * LaneTraits<T>::kCount);
    }
}

template <std::size_t kWidth, class T, class S = typename LaneTraits<T>::Scalar>
HWY_INLINE void store_rows(const T (&from)[kPanelRegisters<T>][kWidth], S* to, std::size_t at,
                           std::size_t end) {
  alignas(64) S lanes[kWidth][kPanel<T>];
  for (int g = 0; g < kPanelRegisters<T>; ++g)
    for (std::size_t i = 0; i < kWidth; ++i) {
      LaneTraits<T>::store(from[g][i], lanes[i] + g * LaneTraits<T>::kCount);
    }
  const std::size_t count = std::min(end - at, kPanel<T>);
  for (std::size_t p = 0; p < count; ++p)
    for (std::size_t i = 0; i < kWidth; ++i) to[kWidth * (at + p) + i] = lanes[i][p];
}

/// Loads 3×3 matrices out of [points, 9].
template <class T, class S = typename LaneTraits<T>::Scalar>
void load_matrices(const S* from, std::size_t at, std::size_t end,
                   Mat3<T> (&to)[kPanelRegisters<T>]) {
  T rows[kPanelRegisters<T>][9];
  load_rows<9, T>(from, at, end, rows);
  for (int g = 0; g < kPanelRegisters<T>; ++g)
    for (int i = 0; i < 9; ++i) to[g][i / 3][i % 3] = rows[g][i];
}

/// F − I of [points, 9]; in lanes beyond the end 0, a deformation that no law minds.
template <class T, class S = typename LaneTraits<T>::Scalar>
void load_deformations(const S* from, std::size_t at, std::size_t end,
                       Mat3<T> (&to)[kPanelRegisters<T>]) {
  S unit[kPanel<T>] = {};
  std::fill_n(unit, std::min(end - at, kPanel<T>), S(1));
  load_matrices(from, at, end, to);
  for (int g = 0; g < kPanelRegisters<T>; ++g) {
    const T one = LaneTraits<T>::load(unit + g * LaneTraits<T>::kCount);
    for (int i = 0; i < 3; ++i) to[g][i][i] -= one;
  }
}

template <class T, class S = typename LaneTraits<T>::Scalar>
void store_matrices(const Mat3<T> (&from)[kPanelRegisters<T>], S* to, std::size_t at,
                    std::size_t end) {
  T rows[kPanelRegisters<T>][9];
  for (int g = 0; g < kPanelRegisters<T>; ++g)
    for (int i = 0; i < 9; ++i) rows[g][i] = from[g][i / 3][i % 3];
  store_rows<9, T>(rows, to, at, end);
}

/// Loads symmetric matrices out of [points, 6]: xx, yy, zz, yz, xz, xy.
template <class T, class S = typename LaneTraits<T>::Scalar>
void load_symmetric(const S* from, std::size_t at, std::size_t end,
                    Sym3<T> (&to)[kPanelRegisters<T>]) {
  T rows[kPanelRegisters<T>][6];
  load_rows<6, T>(from, at, end, rows);
  for (int g = 0; g < kPanelRegisters<T>; ++g) {
    const T* r = rows[g];
    to[g] = {r[0], r[1], r[2], r[3], r[4], r[5]};
  }
}

template <class T, class S = typename LaneTraits<T>::Scalar>
void store_symmetric(const Sym3<T> (&from)[kPanelRegisters<T>], S* to, std::size_t at,
                     std::size_t end) {
  T rows[kPanelRegisters<T>][6];
  for (int g = 0; g < kPanelRegisters<T>; ++g) {
    const Sym3<T>& s = from[g];
    const T entries[6] = {s.xx, s.yy, s.zz, s.yz, s.xz, s.xy};
    for (int i = 0; i < 6; ++i) rows[g][i] = entries[i];
  }
  store_rows<6, T>(rows, to, at, end);
}

/// Loads numbers out of [points].
template <class T, class S = typename LaneTraits<T>::Scalar>
void load_numbers(const S* from, std::size_t at, std::size_t end, T (&to)[kPanelRegisters<T>]) {
  T rows[kPanelRegisters<T>][1];
  load_rows<1, T>(from, at, end, rows);
  for (int g = 0; g < kPanelRegisters<T>; ++g) to[g] = rows[g][0];
}

template <class T, class S = typename LaneTraits<T>::Scalar>
void store_numbers(const T (&from)[kPanelRegisters<T>], S* to, std::size_t at, std::size_t end) {
  T rows[kPanelRegisters<T>][1];
  for (int g = 0; g < kPanelRegisters<T>; ++g) rows[g][0] = from[g];
  store_rows<1, T>(rows, to, at, end);
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
