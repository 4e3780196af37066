// SPDX-License-Identifier: GPL-3.0-or-later
// Adjoints of the 3×3 algebra of mat3-inl.hpp and what they are written with. Included once per
// SIMD target.
#if defined(MATTERFIT_MATH_MAT3_ADJOINT_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATH_MAT3_ADJOINT_INL_HPP
#undef MATTERFIT_MATH_MAT3_ADJOINT_INL_HPP
#else
#define MATTERFIT_MATH_MAT3_ADJOINT_INL_HPP
#endif

#include "math/mat3-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class T>
HWY_INLINE Mat3<T> to_matrix(const Sym3<T>& s) {
  return {{{s.xx, s.xy, s.xz}, {s.xy, s.yy, s.yz}, {s.xz, s.yz, s.zz}}};
}

/// ½ (M + Mᵀ).
template <class T>
HWY_INLINE Sym3<T> symmetric_part(const Mat3<T>& m) {
  const T half = scalar<T>(0.5);
  return {m[0][0],
          m[1][1],
          m[2][2],
          half * (m[1][2] + m[2][1]),
          half * (m[0][2] + m[2][0]),
          half * (m[0][1] + m[1][0])};
}

/// A : B.
template <class T>
HWY_INLINE T contract(const Sym3<T>& a, const Sym3<T>& b) {
  const T off = fma(a.yz, b.yz, fma(a.xz, b.xz, a.xy * b.xy));
  return fma(a.xx, b.xx, fma(a.yy, b.yy, fma(a.zz, b.zz, off + off)));
}

template <class T>
HWY_INLINE T contract(const Mat3<T>& a, const Mat3<T>& b) {
  T sum = scalar<T>(0);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) sum = fma(a[i][j], b[i][j], sum);
  return sum;
}

template <class T>
HWY_INLINE void add(const Mat3<T>& m, Mat3<T>& to) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) to[i][j] += m[i][j];
}

template <class T>
HWY_INLINE void add_twice(const Mat3<T>& m, Mat3<T>& to) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) to[i][j] += m[i][j] + m[i][j];
}

/// factor · M added.
template <class T>
HWY_INLINE void add_scaled(const Mat3<T>& m, T factor, Mat3<T>& to) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) to[i][j] = fma(factor, m[i][j], to[i][j]);
}

/// Aᵀ B.
template <class T>
HWY_INLINE Mat3<T> transpose_multiply(const Mat3<T>& a, const Mat3<T>& b) {
  Mat3<T> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c[i][j] = fma(a[0][i], b[0][j], fma(a[1][i], b[1][j], a[2][i] * b[2][j]));
  return c;
}

/// A Bᵀ.
template <class T>
HWY_INLINE Mat3<T> multiply_transpose(const Mat3<T>& a, const Mat3<T>& b) {
  Mat3<T> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c[i][j] = fma(a[i][0], b[j][0], fma(a[i][1], b[j][1], a[i][2] * b[j][2]));
  return c;
}

/// Vᵀ M V.
template <class T>
HWY_INLINE Mat3<T> rotate_back(const Mat3<T>& v, const Mat3<T>& m) {
  return transpose_multiply(v, multiply(m, v));
}

/// V M Vᵀ.
template <class T>
HWY_INLINE Mat3<T> rotate_forth(const Mat3<T>& v, const Mat3<T>& m) {
  return multiply(v, multiply_transpose(m, v));
}

/// (A × B)ᵢⱼ = εᵢₖₗ εⱼₘₙ Aₖₘ Bₗₙ: cof F = ½ F × F, so that the adjoint of cof adds cof_bar × F.
template <class T>
HWY_INLINE Mat3<T> tensor_cross(const Mat3<T>& a, const Mat3<T>& b) {
  Mat3<T> c;
  for (int i = 0; i < 3; ++i) {
    const int k = (i + 1) % 3;
    const int l = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int m = (j + 1) % 3;
      const int n = (j + 2) % 3;
      c[i][j] = (a[k][m] * b[l][n] - a[k][n] * b[l][m]) + (a[l][n] * b[k][m] - a[l][m] * b[k][n]);
    }
  }
  return c;
}

/// Adjoint of R = polar_rotation(F). With dR = R Ω and S = RᵀF, (tr S I − S) ω = axial(RᵀdF −
/// dFᵀR).
template <class T>
HWY_INLINE void add_polar_adjoint(const Mat3<T>& f, const Mat3<T>& r, const Mat3<T>& r_bar,
                                  Mat3<T>& f_bar) {
  const Sym3<T> s = symmetric_part(transpose_multiply(r, f));
  const Mat3<T> m = transpose_multiply(r, r_bar);
  const T half = scalar<T>(0.5);
  const T axial[3] = {half * (m[2][1] - m[1][2]), half * (m[0][2] - m[2][0]),
                      half * (m[1][0] - m[0][1])};
  const Mat3<T> k{
      {{s.yy + s.zz, -s.xy, -s.xz}, {-s.xy, s.xx + s.zz, -s.yz}, {-s.xz, -s.yz, s.xx + s.yy}}};
  const Mat3<T> c = cofactor(k);
  const T inverse = scalar<T>(1) / fma(k[0][0], c[0][0], fma(k[0][1], c[0][1], k[0][2] * c[0][2]));
  T b[3];
  for (int i = 0; i < 3; ++i) {
    b[i] = inverse * fma(c[i][0], axial[0], fma(c[i][1], axial[1], c[i][2] * axial[2]));
  }
  const T zero = scalar<T>(0);
  const Mat3<T> skew{{{zero, -b[2], b[1]}, {b[2], zero, -b[0]}, {-b[1], b[0], zero}}};
  add_twice(multiply(r, skew), f_bar);
}

/// log(1 + x)/x.
template <class T>
HWY_INLINE T log1p_over(T x) {
  using S = typename LaneTraits<T>::Scalar;
  // Below 0.02 nine terms of the series reach double rounding.
  T series = T(S(1.0 / 9.0));
  for (int n = 8; n >= 1; --n) series = fma(-x, series, T(S(1.0 / n)));
  const auto small = abs(x) < T(S(0.02));
  return select(small, series, log1p(x) / select(small, T(S(1)), x));
}

/// (eˣ − 1)/x.
template <class T>
HWY_INLINE T expm1_over(T x) {
  using S = typename LaneTraits<T>::Scalar;
  T series = T(S(1.0 / 40320));
  for (const double c : {1.0 / 5040, 1.0 / 720, 1.0 / 120, 1.0 / 24, 1.0 / 6, 0.5, 1.0}) {
    series = fma(series, x, T(S(c)));
  }
  const auto small = abs(x) < T(S(0.1));
  return select(small, series, (exp(x) - T(S(1))) / select(small, T(S(1)), x));
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
