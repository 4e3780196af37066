// SPDX-License-Identifier: GPL-3.0-or-later
// F = U Σ Vᵀ with rotations U, V and σ descending, the determinant's sign on the last, and the
// deformation rebuilt from σ clamped from below; with the adjoint of (σ, R = U Vᵀ, clamped F), in
// which no difference of singular values is left to divide by. Included once per SIMD target.
#if defined(MATTERFIT_MATERIAL_NEURAL_SIGNED_SVD_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_NEURAL_SIGNED_SVD_INL_HPP
#undef MATTERFIT_MATERIAL_NEURAL_SIGNED_SVD_INL_HPP
#else
#define MATTERFIT_MATERIAL_NEURAL_SIGNED_SVD_INL_HPP
#endif

#include "math/mat3_adjoint-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Singular values are clamped from below here before a net sees them (as published).
inline constexpr double kLeastStretch = 0.05;

template <class T>
struct SignedSvd {
  T sigma_minus_one[3];  ///< as they are, not clamped
  Mat3<T> u;
  Mat3<T> v;
};

template <class T>
HWY_INLINE T dot3(const T a[3], const T b[3]) {
  return fma(a[0], b[0], fma(a[1], b[1], a[2] * b[2]));
}

/// The decomposition of F = I + `h`, from the eigenvectors of FᵀF − I, so that σ − 1 keeps its
/// digits.
template <class T>
HWY_INLINE SignedSvd<T> signed_svd(const Mat3<T>& h) {
  const T one = scalar<T>(1);
  const T zero = scalar<T>(0);
  T e[3];
  Mat3<T> v;
  eigen_symmetric(right_cauchy_green_minus_identity(h), e, v);
  const auto order = [&](int a, int b) {
    const auto swap = e[a] < e[b];
    const T ea = e[a];
    e[a] = select(swap, e[b], ea);
    e[b] = select(swap, ea, e[b]);
    for (int k = 0; k < 3; ++k) {
      const T va = v[k][a];
      v[k][a] = select(swap, v[k][b], va);
      v[k][b] = select(swap, va, v[k][b]);
    }
  };
  order(0, 1);
  order(1, 2);
  order(0, 1);
  T column[3][3];  // of V
  for (int k = 0; k < 3; ++k) {
    column[0][k] = v[k][0];
    column[1][k] = v[k][1];
  }
  const auto cross = [](const T a[3], const T b[3], T c[3]) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
  };
  cross(column[0], column[1], column[2]);
  const auto image = [&](const T x[3], T y[3]) {  // F x
    for (int k = 0; k < 3; ++k) y[k] = x[k] + dot3(h[k], x);
  };
  const auto normalise = [&](T x[3]) {
    const T inverse = one / sqrt(max(dot3(x, x), scalar<T>(1e-30)));
    for (int k = 0; k < 3; ++k) x[k] = x[k] * inverse;
  };
  T left[3][3];
  image(column[0], left[0]);
  normalise(left[0]);
  image(column[1], left[1]);
  const T along = dot3(left[0], left[1]);
  for (int k = 0; k < 3; ++k) left[1][k] = fnma(along, left[0][k], left[1][k]);
  normalise(left[1]);
  cross(left[0], left[1], left[2]);
  T last[3];
  image(column[2], last);
  const T sigma3 = dot3(left[2], last);

  SignedSvd<T> out;
  for (int i = 0; i < 3; ++i) {
    const T from_square = e[i] / (one + sqrt(max(one + e[i], zero)));
    // A small or negative last one has its digits and its sign in u₃ · F v₃.
    out.sigma_minus_one[i] =
        i < 2 ? from_square : select(sigma3 > scalar<T>(0.7), from_square, sigma3 - one);
    for (int k = 0; k < 3; ++k) {
      out.u[k][i] = left[i][k];
      out.v[k][i] = column[i][k];
    }
  }
  return out;
}

/// I + result: F with its singular values clamped; `clamped` gets σ − 1 after that.
template <class T>
HWY_INLINE Mat3<T> clamp_stretches(const Mat3<T>& h, const SignedSvd<T>& svd, T clamped[3]) {
  Mat3<T> out = h;
  T missing[3];
  for (int i = 0; i < 3; ++i) {
    clamped[i] = max(svd.sigma_minus_one[i], scalar<T>(kLeastStretch - 1.0));
    missing[i] = clamped[i] - svd.sigma_minus_one[i];
  }
  const T most = max(missing[0], max(missing[1], missing[2]));
  if (none(most > scalar<T>(0), most)) return out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) out[i][j] = fma(svd.u[i][k] * missing[k], svd.v[j][k], out[i][j]);
  return out;
}

/// Adds to `f_bar` the cotangent of F from those of the clamped σ, of R and of the clamped F. With
/// M = Uᵀ dF V: dσᵢ = Mᵢᵢ, (Uᵀ dR V)ᵢⱼ = (Mᵢⱼ − Mⱼᵢ)/(σᵢ + σⱼ), and the clamped F = U f(Σ) Vᵀ has
/// the divided differences (fᵢ ∓ fⱼ)/(σᵢ ∓ σⱼ) on the symmetric and the skew part, the first in
/// [0, 1]. Sums of singular values near 0, of inverted elements, are bounded.
template <class T>
HWY_INLINE void add_signed_svd_adjoint(const SignedSvd<T>& svd, const T sigma_bar[3],
                                       const Mat3<T>& r_bar, const Mat3<T>& clamped_bar,
                                       Mat3<T>& f_bar) {
  const T one = scalar<T>(1);
  const T zero = scalar<T>(0);
  const T half = scalar<T>(0.5);
  const T least = scalar<T>(kLeastStretch);
  T sigma[3];
  T smallest = one;
  for (int i = 0; i < 3; ++i) {
    sigma[i] = svd.sigma_minus_one[i] + one;
    smallest = min(smallest, sigma[i]);
  }
  const auto in_frame = [&](const Mat3<T>& m) {
    return transpose_multiply(svd.u, multiply(m, svd.v));
  };
  const auto bounded_sum = [&](int i, int j) { return max(sigma[i] + sigma[j], least); };
  const Mat3<T> q = in_frame(r_bar);
  Mat3<T> m_bar;
  for (int i = 0; i < 3; ++i) {
    m_bar[i][i] = select(sigma[i] > least, sigma_bar[i], zero);
    for (int j = 0; j < i; ++j) {
      const T turn = (q[i][j] - q[j][i]) / bounded_sum(i, j);
      m_bar[i][j] = turn;
      m_bar[j][i] = -turn;
    }
  }
  if (none(smallest < least, smallest)) {
    add(clamped_bar, f_bar);
  } else {
    const Mat3<T> c = in_frame(clamped_bar);
    for (int i = 0; i < 3; ++i) {
      const T fi = max(sigma[i], least);
      m_bar[i][i] += select(sigma[i] > least, c[i][i], zero);
      for (int j = 0; j < i; ++j) {
        const T fj = max(sigma[j], least);
        // σⱼ ≥ σᵢ: 1 where neither is clamped, 0 where both are.
        const T gap = sigma[j] - sigma[i];
        const T stretch =
            select(sigma[i] > least, one,
                   select(sigma[j] > least, (fj - fi) / max(gap, scalar<T>(1e-12)), zero));
        const T turn = select(sigma[i] > least, one, (fi + fj) / bounded_sum(i, j));
        const T even = half * stretch * (c[i][j] + c[j][i]);
        const T odd = half * turn * (c[i][j] - c[j][i]);
        m_bar[i][j] += even + odd;
        m_bar[j][i] += even - odd;
      }
    }
  }
  add(multiply(svd.u, multiply_transpose(m_bar, svd.v)), f_bar);
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
