// SPDX-License-Identifier: GPL-3.0-or-later
// From a Gaussian in the world to its footprint in the image and back by the adjoint, over a
// scalar or a register of lanes (rasteriser.hpp has the formulas). Included once per SIMD target.
#if defined(MATTERFIT_SPLAT_PROJECTION_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_SPLAT_PROJECTION_INL_HPP
#undef MATTERFIT_SPLAT_PROJECTION_INL_HPP
#else
#define MATTERFIT_SPLAT_PROJECTION_INL_HPP
#endif

#include "math/mat3-inl.hpp"
#include "splat/sh_basis-inl.hpp"
#include "splat/view.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class T>
struct GaussianShape {
  T mean[3];
  T log_scale[3];
  T rotation[4];  ///< w x y z
  T f[3][3];      ///< deformation gradient; read if there is one
};

template <class T>
struct Projection {
  T mean[2];  ///< [pixels]
  T depth;
  T covariance[3];  ///< Σ₂: xx, xy, yy
  T determinant;    ///< of Σ₂
  T sharp;          ///< determinant of Σ₂ − blur I
  // What the adjoint needs again.
  T t[3];  ///< mean in camera axes
  T inverse_depth;
  T ray[2];      ///< t_x/t_z, t_y/t_z
  T clamped[2];  ///< the same within the bounds
  T p[2][3];     ///< J W
  T b[2][3];     ///< J W F
  T r[3][3];     ///< of the quaternion
  T a[2][3];     ///< J W F R
  T scale[3];
};

/// K of R = I + s K, s = 2/|q|².
template <class T>
HWY_INLINE void quaternion_terms(const T (&q)[4], T (&k)[3][3]) {
  const T w = q[0];
  const T x = q[1];
  const T y = q[2];
  const T z = q[3];
  k[0][0] = -(y * y + z * z);
  k[0][1] = x * y - w * z;
  k[0][2] = x * z + w * y;
  k[1][0] = x * y + w * z;
  k[1][1] = -(x * x + z * z);
  k[1][2] = y * z - w * x;
  k[2][0] = x * z - w * y;
  k[2][1] = y * z + w * x;
  k[2][2] = -(x * x + y * y);
}

template <class T>
HWY_INLINE T twice_inverse_square(const T (&q)[4]) {
  return scalar<T>(2.0) / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
}

/// Adds to `bar` the derivatives with respect to q of what has the derivatives `r` in R.
template <class T>
HWY_INLINE void rotation_adjoint(const T (&q)[4], const T (&r)[3][3], T (&bar)[4]) {
  T k[3][3];
  quaternion_terms(q, k);
  const T s = twice_inverse_square(q);
  T along = scalar<T>(0.0);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) along = fma(r[i][j], k[i][j], along);
  along *= s * s;
  const T w = q[0];
  const T x = q[1];
  const T y = q[2];
  const T z = q[3];
  const T two = scalar<T>(2.0);
  const T xy = r[0][1] + r[1][0];
  const T xz = r[0][2] + r[2][0];
  const T yz = r[1][2] + r[2][1];
  const T turn[3] = {r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]};
  bar[0] = s * (x * turn[0] + y * turn[1] + z * turn[2]) - along * w;
  bar[1] = s * (y * xy + z * xz + w * turn[0] - two * x * (r[1][1] + r[2][2])) - along * x;
  bar[2] = s * (x * xy + z * yz + w * turn[1] - two * y * (r[0][0] + r[2][2])) - along * y;
  bar[3] = s * (x * xz + y * yz + w * turn[2] - two * z * (r[0][0] + r[1][1])) - along * z;
}

template <class T>
HWY_INLINE void project(const GaussianShape<T>& g, bool deformed, const splat::View& view,
                        Projection<T>& out) {
  const auto& w = view.rotation;
  for (int i = 0; i < 3; ++i) {
    out.t[i] = fma(g.mean[0], scalar<T>(w[i][0]),
                   fma(g.mean[1], scalar<T>(w[i][1]),
                       fma(g.mean[2], scalar<T>(w[i][2]), scalar<T>(view.translation[i]))));
  }
  out.depth = out.t[2];
  out.inverse_depth = scalar<T>(1.0) / out.t[2];
  for (int k = 0; k < 2; ++k) {
    out.ray[k] = out.t[k] * out.inverse_depth;
    out.clamped[k] = min(max(out.ray[k], scalar<T>(view.low[k])), scalar<T>(view.high[k]));
    const T focal = scalar<T>(view.focal[k]);
    out.mean[k] = fma(focal, out.ray[k], scalar<T>(view.principal[k]));
    // J's row is f/t_z (1, 0, −t_x/t_z) or (0, 1, −t_y/t_z).
    const T factor = focal * out.inverse_depth;
    for (int j = 0; j < 3; ++j) {
      out.p[k][j] = factor * (scalar<T>(w[k][j]) - out.clamped[k] * scalar<T>(w[2][j]));
    }
  }
  const T s = twice_inverse_square(g.rotation);
  quaternion_terms(g.rotation, out.r);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      out.r[i][j] = i == j ? fma(s, out.r[i][j], scalar<T>(1.0)) : s * out.r[i][j];
    }
    // Squares of what is beyond have no place in a double either.
    out.scale[i] = exp(min(max(g.log_scale[i], scalar<T>(-700.0)), scalar<T>(700.0)));
  }
  for (int k = 0; k < 2; ++k) {
    for (int j = 0; j < 3; ++j) {
      out.b[k][j] = deformed ? fma(out.p[k][0], g.f[0][j],
                                   fma(out.p[k][1], g.f[1][j], out.p[k][2] * g.f[2][j]))
                             : out.p[k][j];
    }
    for (int j = 0; j < 3; ++j) {
      out.a[k][j] =
          fma(out.b[k][0], out.r[0][j], fma(out.b[k][1], out.r[1][j], out.b[k][2] * out.r[2][j]));
    }
  }
  // Σ₂ = V Vᵀ + blur I; its determinant as a sum of squares (Cauchy–Binet), so that a thin
  // footprint does not lose it by cancellation.
  T v[2][3];
  for (int k = 0; k < 2; ++k)
    for (int j = 0; j < 3; ++j) v[k][j] = out.a[k][j] * out.scale[j];
  const T xx = v[0][0] * v[0][0] + v[0][1] * v[0][1] + v[0][2] * v[0][2];
  const T xy = v[0][0] * v[1][0] + v[0][1] * v[1][1] + v[0][2] * v[1][2];
  const T yy = v[1][0] * v[1][0] + v[1][1] * v[1][1] + v[1][2] * v[1][2];
  const T m0 = v[0][1] * v[1][2] - v[0][2] * v[1][1];
  const T m1 = v[0][2] * v[1][0] - v[0][0] * v[1][2];
  const T m2 = v[0][0] * v[1][1] - v[0][1] * v[1][0];
  const T blur = scalar<T>(view.blur);
  out.covariance[0] = xx + blur;
  out.covariance[1] = xy;
  out.covariance[2] = yy + blur;
  out.sharp = m0 * m0 + m1 * m1 + m2 * m2;
  out.determinant = out.sharp + blur * (xx + yy + blur);
}

/// Derivatives of a loss in a footprint.
template <class T>
struct ProjectionAdjoint {
  T mean[2];
  T depth;
  T covariance[3];  ///< ∂/∂xx, ∂/∂xy (of both off-diagonal elements together), ∂/∂yy
};

/// Adds to Σ₂'s derivatives those of ln √(det (Σ₂ − blur I) / det Σ₂) times `bar`.
template <class T>
HWY_INLINE void sharpness_adjoint(const splat::View& view, const Projection<T>& at, const T& bar,
                                  ProjectionAdjoint<T>& out) {
  const T blur = scalar<T>(view.blur);
  const T half = scalar<T>(0.5) * bar;
  out.covariance[0] +=
      half * ((at.covariance[2] - blur) / at.sharp - at.covariance[2] / at.determinant);
  out.covariance[1] -=
      bar * at.covariance[1] * (scalar<T>(1.0) / at.sharp - scalar<T>(1.0) / at.determinant);
  out.covariance[2] +=
      half * ((at.covariance[0] - blur) / at.sharp - at.covariance[0] / at.determinant);
}

/// Derivatives in the Gaussian, and in the pose: (ω, τ) of GaussianGradients::pose.
template <class T>
struct ShapeAdjoint {
  T mean[3];
  T log_scale[3];
  T rotation[4];
  T f[3][3];
  T pose[6];
};

template <class T>
HWY_INLINE void project_adjoint(const GaussianShape<T>& g, bool deformed, const splat::View& view,
                                const Projection<T>& at, const ProjectionAdjoint<T>& bar,
                                ShapeAdjoint<T>& out) {
  const auto& w = view.rotation;
  const T zero = scalar<T>(0.0);
  // Σ₂ = V Vᵀ: dL = 2 tr(Ḡ dV Vᵀ) with Ḡ symmetric, half of `xy` in each corner.
  const T gxx = bar.covariance[0] + bar.covariance[0];
  const T gxy = bar.covariance[1];
  const T gyy = bar.covariance[2] + bar.covariance[2];
  T a_bar[2][3];
  for (int j = 0; j < 3; ++j) {
    const T v0 = at.a[0][j] * at.scale[j];
    const T v1 = at.a[1][j] * at.scale[j];
    const T d0 = gxx * v0 + gxy * v1;
    const T d1 = gxy * v0 + gyy * v1;
    out.log_scale[j] = d0 * v0 + d1 * v1;
    a_bar[0][j] = d0 * at.scale[j];
    a_bar[1][j] = d1 * at.scale[j];
  }
  T r_bar[3][3];
  T b_bar[2][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      r_bar[i][j] = at.b[0][i] * a_bar[0][j] + at.b[1][i] * a_bar[1][j];
    }
    for (int k = 0; k < 2; ++k) {
      b_bar[k][i] = a_bar[k][0] * at.r[i][0] + a_bar[k][1] * at.r[i][1] + a_bar[k][2] * at.r[i][2];
    }
  }
  rotation_adjoint(g.rotation, r_bar, out.rotation);
  T p_bar[2][3];
  for (int i = 0; i < 3; ++i) {
    if (deformed) {
      for (int j = 0; j < 3; ++j) {
        out.f[i][j] = at.p[0][i] * b_bar[0][j] + at.p[1][i] * b_bar[1][j];
      }
      for (int k = 0; k < 2; ++k) {
        p_bar[k][i] = b_bar[k][0] * g.f[i][0] + b_bar[k][1] * g.f[i][1] + b_bar[k][2] * g.f[i][2];
      }
    } else {
      p_bar[0][i] = b_bar[0][i];
      p_bar[1][i] = b_bar[1][i];
    }
  }
  // p_k = f_k/t_z (w_k − c_k w_2), c the clamped ray: derivatives in c, 1/t_z and W.
  T t_bar[3] = {zero, zero, bar.depth};
  T w_bar[3][3];  // in W, through J W alone
  for (int j = 0; j < 3; ++j) w_bar[2][j] = zero;
  T inverse_bar = zero;
  for (int k = 0; k < 2; ++k) {
    const T focal = scalar<T>(view.focal[k]);
    const T factor = focal * at.inverse_depth;
    T along_k = zero;
    T along_2 = zero;
    for (int j = 0; j < 3; ++j) {
      along_k = fma(p_bar[k][j], scalar<T>(w[k][j]), along_k);
      along_2 = fma(p_bar[k][j], scalar<T>(w[2][j]), along_2);
      w_bar[k][j] = factor * p_bar[k][j];
      w_bar[2][j] -= factor * at.clamped[k] * p_bar[k][j];
    }
    inverse_bar += focal * (along_k - at.clamped[k] * along_2);
    const T through_clamp =
        select(at.ray[k] < scalar<T>(view.low[k]), zero,
               select(at.ray[k] > scalar<T>(view.high[k]), zero, -(factor * along_2)));
    const T ray_bar = fma(focal, bar.mean[k], through_clamp);
    t_bar[k] = ray_bar * at.inverse_depth;
    inverse_bar += ray_bar * at.t[k];
  }
  t_bar[2] -= inverse_bar * at.inverse_depth * at.inverse_depth;
  for (int j = 0; j < 3; ++j) {
    out.mean[j] = t_bar[0] * scalar<T>(w[0][j]) + t_bar[1] * scalar<T>(w[1][j]) +
                  t_bar[2] * scalar<T>(w[2][j]);
  }
  // t' = t + ω × t + τ, W' = W + [ω]× W.
  T turned[3][3];  // W̄ Wᵀ
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      turned[i][j] = w_bar[i][0] * scalar<T>(w[j][0]) + w_bar[i][1] * scalar<T>(w[j][1]) +
                     w_bar[i][2] * scalar<T>(w[j][2]);
    }
  }
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    out.pose[i] = at.t[j] * t_bar[k] - at.t[k] * t_bar[j] + turned[k][j] - turned[j][k];
    out.pose[3 + i] = t_bar[i];
  }
}

/// The unit direction from the camera's centre to a mean, and its distance.
template <class T>
HWY_INLINE T direction_of(const T (&mean)[3], const splat::View& view, T (&d)[3]) {
  for (int k = 0; k < 3; ++k) d[k] = mean[k] - scalar<T>(view.centre[k]);
  const T distance = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  for (int k = 0; k < 3; ++k) d[k] = d[k] / distance;
  return distance;
}

/// Adds to the shape's derivatives those through the direction, `g` = ∂L/∂d off the sphere.
template <class T>
HWY_INLINE void direction_adjoint(const T (&d)[3], const T& distance, const T (&g)[3],
                                  const splat::View& view, ShapeAdjoint<T>& out) {
  const T radial = d[0] * g[0] + d[1] * g[1] + d[2] * g[2];
  T mean_bar[3];
  for (int k = 0; k < 3; ++k) {
    mean_bar[k] = (g[k] - d[k] * radial) / distance;
    out.mean[k] += mean_bar[k];
  }
  // The centre moves by −Wᵀ τ and does not feel ω.
  for (int i = 0; i < 3; ++i) {
    out.pose[3 + i] += mean_bar[0] * scalar<T>(view.rotation[i][0]) +
                       mean_bar[1] * scalar<T>(view.rotation[i][1]) +
                       mean_bar[2] * scalar<T>(view.rotation[i][2]);
  }
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
