// SPDX-License-Identifier: GPL-3.0-or-later
// 3×3 algebra over a scalar or a register of lanes (lanes-inl.hpp). Included once per SIMD target.
#if defined(MATTERFIT_MATH_MAT3_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATH_MAT3_INL_HPP
#undef MATTERFIT_MATH_MAT3_INL_HPP
#else
#define MATTERFIT_MATH_MAT3_INL_HPP
#endif

#include "math/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class T>
struct Mat3 {
  T m[3][3];
  HWY_INLINE T* operator[](int row) { return m[row]; }
  HWY_INLINE const T* operator[](int row) const { return m[row]; }
};

/// Symmetric: xx, yy, zz, yz, xz, xy.
template <class T>
struct Sym3 {
  T xx, yy, zz, yz, xz, xy;
};

template <class T>
HWY_INLINE T scalar(double value) {
  return T(static_cast<typename LaneTraits<T>::Scalar>(value));
}

template <class T>
HWY_INLINE Mat3<T> multiply(const Mat3<T>& a, const Mat3<T>& b) {
  Mat3<T> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c[i][j] = fma(a[i][0], b[0][j], fma(a[i][1], b[1][j], a[i][2] * b[2][j]));
  return c;
}

template <class T>
HWY_INLINE Mat3<T> multiply(const Sym3<T>& s, const Mat3<T>& b) {
  Mat3<T> c;
  for (int j = 0; j < 3; ++j) {
    c[0][j] = fma(s.xx, b[0][j], fma(s.xy, b[1][j], s.xz * b[2][j]));
    c[1][j] = fma(s.xy, b[0][j], fma(s.yy, b[1][j], s.yz * b[2][j]));
    c[2][j] = fma(s.xz, b[0][j], fma(s.yz, b[1][j], s.zz * b[2][j]));
  }
  return c;
}

template <class T>
HWY_INLINE Mat3<T> multiply(const Mat3<T>& a, const Sym3<T>& s) {
  Mat3<T> c;
  for (int i = 0; i < 3; ++i) {
    c[i][0] = fma(a[i][0], s.xx, fma(a[i][1], s.xy, a[i][2] * s.xz));
    c[i][1] = fma(a[i][0], s.xy, fma(a[i][1], s.yy, a[i][2] * s.yz));
    c[i][2] = fma(a[i][0], s.xz, fma(a[i][1], s.yz, a[i][2] * s.zz));
  }
  return c;
}

/// Cofactor matrix, det(F) F⁻ᵀ.
template <class T>
HWY_INLINE Mat3<T> cofactor(const Mat3<T>& f) {
  Mat3<T> c;
  c[0][0] = f[1][1] * f[2][2] - f[1][2] * f[2][1];
  c[0][1] = f[1][2] * f[2][0] - f[1][0] * f[2][2];
  c[0][2] = f[1][0] * f[2][1] - f[1][1] * f[2][0];
  c[1][0] = f[2][1] * f[0][2] - f[2][2] * f[0][1];
  c[1][1] = f[2][2] * f[0][0] - f[2][0] * f[0][2];
  c[1][2] = f[2][0] * f[0][1] - f[2][1] * f[0][0];
  c[2][0] = f[0][1] * f[1][2] - f[0][2] * f[1][1];
  c[2][1] = f[0][2] * f[1][0] - f[0][0] * f[1][2];
  c[2][2] = f[0][0] * f[1][1] - f[0][1] * f[1][0];
  return c;
}

/// det(I + H) − 1 = tr H + (sum of the principal 2×2 minors) + det H: no cancellation near F = I.
template <class T>
HWY_INLINE T determinant_minus_one(const Mat3<T>& h) {
  const T minors = (h[0][0] * h[1][1] - h[0][1] * h[1][0]) +
                   (h[0][0] * h[2][2] - h[0][2] * h[2][0]) +
                   (h[1][1] * h[2][2] - h[1][2] * h[2][1]);
  const T det = fma(h[0][0], h[1][1] * h[2][2] - h[1][2] * h[2][1],
                    fma(h[0][1], h[1][2] * h[2][0] - h[1][0] * h[2][2],
                        h[0][2] * (h[1][0] * h[2][1] - h[1][1] * h[2][0])));
  return ((h[0][0] + h[1][1]) + h[2][2]) + minors + det;
}

template <class T>
HWY_INLINE Mat3<T> plus_identity(Mat3<T> h) {
  for (int i = 0; i < 3; ++i) h[i][i] = h[i][i] + scalar<T>(1);
  return h;
}

/// FᵀF − I = H + Hᵀ + HᵀH for F = I + H.
template <class T>
HWY_INLINE Sym3<T> right_cauchy_green_minus_identity(const Mat3<T>& h) {
  const auto dot = [&](int i, int j) {
    return fma(h[0][i], h[0][j], fma(h[1][i], h[1][j], h[2][i] * h[2][j]));
  };
  return {h[0][0] + h[0][0] + dot(0, 0), h[1][1] + h[1][1] + dot(1, 1),
          h[2][2] + h[2][2] + dot(2, 2), h[1][2] + h[2][1] + dot(1, 2),
          h[0][2] + h[2][0] + dot(0, 2), h[0][1] + h[1][0] + dot(0, 1)};
}

/// FFᵀ − I = H + Hᵀ + HHᵀ for F = I + H.
template <class T>
HWY_INLINE Sym3<T> left_cauchy_green_minus_identity(const Mat3<T>& h) {
  const auto dot = [&](int i, int j) {
    return fma(h[i][0], h[j][0], fma(h[i][1], h[j][1], h[i][2] * h[j][2]));
  };
  return {h[0][0] + h[0][0] + dot(0, 0), h[1][1] + h[1][1] + dot(1, 1),
          h[2][2] + h[2][2] + dot(2, 2), h[1][2] + h[2][1] + dot(1, 2),
          h[0][2] + h[2][0] + dot(0, 2), h[0][1] + h[1][0] + dot(0, 1)};
}

/// The rotation R of F = R S, by Newton's iteration R ← ½(gR + R⁻ᵀ/g) with Higham's scaling in the
/// first two steps, quadratic from there: for singular values in [0.05, 20] six steps reach float
/// rounding, eight double's. For det F > 0.
template <class T>
HWY_INLINE Mat3<T> polar_rotation(const Mat3<T>& f) {
  constexpr int kSteps = sizeof(typename LaneTraits<T>::Scalar) == 4 ? 6 : 8;
  Mat3<T> r = f;
  for (int step = 0; step < kSteps; ++step) {
    const Mat3<T> c = cofactor(r);
    const T det = fma(r[0][0], c[0][0], fma(r[0][1], c[0][1], r[0][2] * c[0][2]));
    T norm_r = scalar<T>(0);
    T norm_c = scalar<T>(0);
    if (step < 2) {
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          norm_r = fma(r[i][j], r[i][j], norm_r);
          norm_c = fma(c[i][j], c[i][j], norm_c);
        }
    }
    // g² = |R⁻¹| / |R|, Frobenius norms.
    const T g = step < 2 ? sqrt(sqrt(norm_c / norm_r) / det) : scalar<T>(1);
    const T keep = scalar<T>(0.5) * g;
    const T inverse = scalar<T>(0.5) / (g * det);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) r[i][j] = fma(keep, r[i][j], inverse * c[i][j]);
  }
  return r;
}

/// Eigenvalues `values` and eigenvectors (columns of `vectors`) of a symmetric matrix by cyclic
/// Jacobi rotations; four sweeps reach float rounding, seven double's.
template <class T>
HWY_INLINE void eigen_symmetric(const Sym3<T>& s, T values[3], Mat3<T>& vectors) {
  using S = typename LaneTraits<T>::Scalar;
  constexpr int kSweeps = sizeof(S) == 4 ? 4 : 7;
  T a[3][3] = {{s.xx, s.xy, s.xz}, {s.xy, s.yy, s.yz}, {s.xz, s.yz, s.zz}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) vectors[i][j] = scalar<T>(i == j ? 1 : 0);
  constexpr S kTiny = sizeof(S) == 4 ? S(1e-30) : S(1e-280);
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (int pair = 0; pair < 3; ++pair) {
      const int p = pair == 2 ? 1 : 0;
      const int q = pair == 0 ? 1 : 2;
      const int r = 3 - p - q;
      // t = tan θ, the smaller root of t² + 2 t cot 2θ − 1 = 0, written so that apq = 0 gives 0.
      const T d = a[q][q] - a[p][p];
      const T two = a[p][q] + a[p][q];
      const T root = sqrt(fma(d, d, two * two)) + T(kTiny);
      const T t = two / (d + select(d < scalar<T>(0), -root, root));
      const T c = scalar<T>(1) / sqrt(fma(t, t, scalar<T>(1)));
      const T sn = t * c;
      const T apq = a[p][q];
      a[p][p] = fnma(t, apq, a[p][p]);
      a[q][q] = fma(t, apq, a[q][q]);
      a[p][q] = a[q][p] = scalar<T>(0);
      const T arp = a[r][p];
      const T arq = a[r][q];
      a[r][p] = a[p][r] = fnma(sn, arq, c * arp);
      a[r][q] = a[q][r] = fma(sn, arp, c * arq);
      for (int k = 0; k < 3; ++k) {
        const T vp = vectors[k][p];
        const T vq = vectors[k][q];
        vectors[k][p] = fnma(sn, vq, c * vp);
        vectors[k][q] = fma(sn, vp, c * vq);
      }
    }
  }
  for (int i = 0; i < 3; ++i) values[i] = a[i][i];
}

/// V diag(d) Vᵀ.
template <class T>
HWY_INLINE Sym3<T> from_eigen(const Mat3<T>& v, const T d[3]) {
  const auto entry = [&](int i, int j) {
    return fma(v[i][0] * d[0], v[j][0], fma(v[i][1] * d[1], v[j][1], v[i][2] * d[2] * v[j][2]));
  };
  return {entry(0, 0), entry(1, 1), entry(2, 2), entry(1, 2), entry(0, 2), entry(0, 1)};
}

/// F S Fᵀ.
template <class T>
HWY_INLINE Sym3<T> push_forward(const Mat3<T>& f, const Sym3<T>& s) {
  const Mat3<T> fs = multiply(f, s);
  const auto dot = [&](int i, int j) {
    return fma(fs[i][0], f[j][0], fma(fs[i][1], f[j][1], fs[i][2] * f[j][2]));
  };
  return {dot(0, 0), dot(1, 1), dot(2, 2), dot(1, 2), dot(0, 2), dot(0, 1)};
}

/// Adds a·I.
template <class T>
HWY_INLINE Sym3<T> add_diagonal(Sym3<T> s, T a) {
  s.xx += a;
  s.yy += a;
  s.zz += a;
  return s;
}

template <class T>
HWY_INLINE Sym3<T> scaled(const Sym3<T>& s, T a) {
  return {a * s.xx, a * s.yy, a * s.zz, a * s.yz, a * s.xz, a * s.xy};
}

template <class T>
HWY_INLINE Sym3<T> sum(const Sym3<T>& a, const Sym3<T>& b) {
  return {a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.yz + b.yz, a.xz + b.xz, a.xy + b.xy};
}

template <class T>
HWY_INLINE Sym3<T> deviator(const Sym3<T>& s) {
  return add_diagonal(s, scalar<T>(-1.0 / 3.0) * (s.xx + s.yy + s.zz));
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
