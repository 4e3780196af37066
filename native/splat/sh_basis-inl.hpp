// SPDX-License-Identifier: GPL-3.0-or-later
// Real spherical harmonics with the order and signs of 3D Gaussian Splatting (Kerbl et al. 2023),
// over a scalar or a register of lanes. Included once per SIMD target.
#if defined(MATTERFIT_SPLAT_SH_BASIS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_SPLAT_SH_BASIS_INL_HPP
#undef MATTERFIT_SPLAT_SH_BASIS_INL_HPP
#else
#define MATTERFIT_SPLAT_SH_BASIS_INL_HPP
#endif

#include "math/mat3-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

inline constexpr double kSh0 = 0.28209479177387814;
inline constexpr double kSh1 = 0.4886025119029199;
inline constexpr double kSh2[] = {1.0925484305920792, 0.31539156525252005, 0.5462742152960396};
inline constexpr double kSh3[] = {0.5900435899266435, 2.890611442640554, 0.4570457994644658,
                                  0.3731763325901154, 1.445305721320277};

/// Values at a unit direction of the (degree + 1)² harmonics up to `degree`.
template <class T>
HWY_INLINE void sh_basis(int degree, const T (&d)[3], T (&y)[16]) {
  const T x = d[0];
  const T v = d[1];
  const T z = d[2];
  y[0] = scalar<T>(kSh0);
  if (degree < 1) return;
  y[1] = scalar<T>(-kSh1) * v;
  y[2] = scalar<T>(kSh1) * z;
  y[3] = scalar<T>(-kSh1) * x;
  if (degree < 2) return;
  const T xx = x * x;
  const T vv = v * v;
  const T zz = z * z;
  const T two = scalar<T>(2.0);
  y[4] = scalar<T>(kSh2[0]) * x * v;
  y[5] = scalar<T>(-kSh2[0]) * v * z;
  y[6] = scalar<T>(kSh2[1]) * (two * zz - xx - vv);
  y[7] = scalar<T>(-kSh2[0]) * x * z;
  y[8] = scalar<T>(kSh2[2]) * (xx - vv);
  if (degree < 3) return;
  const T three = scalar<T>(3.0);
  const T four = scalar<T>(4.0);
  y[9] = scalar<T>(-kSh3[0]) * v * (three * xx - vv);
  y[10] = scalar<T>(kSh3[1]) * x * v * z;
  y[11] = scalar<T>(-kSh3[2]) * v * (four * zz - xx - vv);
  y[12] = scalar<T>(kSh3[3]) * z * (two * zz - three * xx - three * vv);
  y[13] = scalar<T>(-kSh3[2]) * x * (four * zz - xx - vv);
  y[14] = scalar<T>(kSh3[4]) * z * (xx - vv);
  y[15] = scalar<T>(-kSh3[0]) * x * (xx - three * vv);
}

/// g = Σ bar_k ∂Y_k/∂d of the polynomials above, whose extension off the sphere the caller
/// projects away.
template <class T>
HWY_INLINE void sh_basis_adjoint(int degree, const T (&d)[3], const T (&bar)[16], T (&g)[3]) {
  const T x = d[0];
  const T v = d[1];
  const T z = d[2];
  g[0] = g[1] = g[2] = scalar<T>(0.0);
  if (degree < 1) return;
  g[0] = scalar<T>(-kSh1) * bar[3];
  g[1] = scalar<T>(-kSh1) * bar[1];
  g[2] = scalar<T>(kSh1) * bar[2];
  if (degree < 2) return;
  const T two = scalar<T>(2.0);
  const T b4 = scalar<T>(kSh2[0]) * bar[4];
  const T b5 = scalar<T>(-kSh2[0]) * bar[5];
  const T b6 = scalar<T>(2.0 * kSh2[1]) * bar[6];
  const T b7 = scalar<T>(-kSh2[0]) * bar[7];
  const T b8 = scalar<T>(2.0 * kSh2[2]) * bar[8];
  g[0] += b4 * v - b6 * x + b7 * z + b8 * x;
  g[1] += b4 * x + b5 * z - b6 * v - b8 * v;
  g[2] += b5 * v + two * b6 * z + b7 * x;
  if (degree < 3) return;
  const T xx = x * x;
  const T vv = v * v;
  const T zz = z * z;
  const T three = scalar<T>(3.0);
  const T four = scalar<T>(4.0);
  const T six = scalar<T>(6.0);
  const T eight = scalar<T>(8.0);
  const T b9 = scalar<T>(-kSh3[0]) * bar[9];
  const T b10 = scalar<T>(kSh3[1]) * bar[10];
  const T b11 = scalar<T>(-kSh3[2]) * bar[11];
  const T b12 = scalar<T>(kSh3[3]) * bar[12];
  const T b13 = scalar<T>(-kSh3[2]) * bar[13];
  const T b14 = scalar<T>(kSh3[4]) * bar[14];
  const T b15 = scalar<T>(-kSh3[0]) * bar[15];
  const T difference = xx - vv;
  g[0] += six * b9 * x * v + b10 * v * z - two * b11 * x * v - six * b12 * x * z +
          b13 * (four * zz - three * xx - vv) + two * b14 * x * z + three * b15 * difference;
  g[1] += three * b9 * difference + b10 * x * z + b11 * (four * zz - xx - three * vv) -
          six * b12 * v * z - two * b13 * x * v - two * b14 * v * z - six * b15 * x * v;
  g[2] += b10 * x * v + eight * b11 * v * z + b12 * three * (two * zz - xx - vv) +
          eight * b13 * x * z + b14 * difference;
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
