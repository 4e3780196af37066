// SPDX-License-Identifier: GPL-3.0-or-later
// Gather from nodes with the derivatives by place. Included once per SIMD target.
//
// Along one axis a quadratic spline over three nodes is known by its value W, slope D and curvature
// S (which is constant in a cell). With δ = f − 1, the sums Σ w (i − f) n of APIC are
//   G = ¼ D + ½ (¼δ − δ³) S,   dG/df = (3/2)(¼ − δ²) S,
// so that values, affine sums and the derivatives of both along all axes take 16 of the products of
// W, D and S, contracted axis by axis.
#if defined(MATTERFIT_MPM_SPLINE_SUMS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_SPLINE_SUMS_INL_HPP
#undef MATTERFIT_MPM_SPLINE_SUMS_INL_HPP
#else
#define MATTERFIT_MPM_SPLINE_SUMS_INL_HPP
#endif

#include "math/mat3-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Where particles lie in their cells.
template <class T>
struct CellPlace {
  T delta[3];  ///< f − 1
  T half[3];   ///< ⅛ + ½ δ²
  T apic[3];   ///< ½ (¼δ − δ³)
  T slope[3];  ///< (3/2)(¼ − δ²)
};

template <class T>
HWY_INLINE CellPlace<T> cell_place(const T f[3]) {
  CellPlace<T> p;
  const T quarter = scalar<T>(0.25);
  for (int a = 0; a < 3; ++a) {
    const T d = f[a] - scalar<T>(1);
    const T d2 = d * d;
    p.delta[a] = d;
    p.half[a] = fma(scalar<T>(0.5), d2, scalar<T>(0.125));
    p.apic[a] = scalar<T>(0.5) * d * (quarter - d2);
    p.slope[a] = scalar<T>(1.5) * (quarter - d2);
  }
  return p;
}

/// Value, slope and curvature along one axis.
template <class T>
struct Along {
  T w, d, s;
};

template <class T>
HWY_INLINE Along<T> along(const CellPlace<T>& p, int axis, T n0, T n1, T n2) {
  const T s = (n0 - n1) + (n2 - n1);
  const T middle = scalar<T>(0.5) * (n2 - n0);
  return {fma(p.half[axis], s, fma(p.delta[axis], middle, n1)), fma(p.delta[axis], s, middle), s};
}

/// Products of W, D and S along x, y and z.
template <class T>
struct SplineSums {
  T www, dww, wdw, wwd, sww, wsw, wws, ddw, dwd, wdd, sdw, dsw, swd, dws, wsd, wds;
};
inline constexpr std::size_t kSplineSums = 16;

/// The sums of one component; load(i, j, k) is the value of a node of the stencil.
template <class T, class Load>
HWY_INLINE SplineSums<T> spline_sums(const CellPlace<T>& p, const Load& load) {
  T ww[3], dw[3], sw[3], wd[3], dd[3], sd[3], ws[3], ds[3];  // along y, z
  for (std::size_t i = 0; i < 3; ++i) {
    Along<T> z[3];
    for (std::size_t j = 0; j < 3; ++j) {
      z[j] = along(p, 2, load(i, j, 0), load(i, j, 1), load(i, j, 2));
    }
    const Along<T> value = along(p, 1, z[0].w, z[1].w, z[2].w);
    const Along<T> slope = along(p, 1, z[0].d, z[1].d, z[2].d);
    const Along<T> curve = along(p, 1, z[0].s, z[1].s, z[2].s);
    ww[i] = value.w;
    dw[i] = value.d;
    sw[i] = value.s;
    wd[i] = slope.w;
    dd[i] = slope.d;
    sd[i] = slope.s;
    ws[i] = curve.w;
    ds[i] = curve.d;
  }
  const Along<T> of_ww = along(p, 0, ww[0], ww[1], ww[2]);
  const Along<T> of_dw = along(p, 0, dw[0], dw[1], dw[2]);
  const Along<T> of_wd = along(p, 0, wd[0], wd[1], wd[2]);
  const Along<T> of_sw = along(p, 0, sw[0], sw[1], sw[2]);
  const Along<T> of_ws = along(p, 0, ws[0], ws[1], ws[2]);
  return {of_ww.w,
          of_ww.d,
          of_dw.w,
          of_wd.w,
          of_ww.s,
          of_sw.w,
          of_ws.w,
          of_dw.d,
          of_wd.d,
          along(p, 0, dd[0], dd[1], dd[2]).w,
          of_dw.s,
          of_sw.d,
          of_wd.s,
          of_ws.d,
          along(p, 0, sd[0], sd[1], sd[2]).w,
          along(p, 0, ds[0], ds[1], ds[2]).w};
}

/// What the transfers take from a component: Σ w n with its derivatives by f, and those of
/// Σ w (x_I − x)/dx n, which are affine_sums().
template <class T>
struct Transferred {
  T value;
  T value_by[3];
  T affine_by[3][3];
};

template <class T>
HWY_INLINE void affine_sums(const CellPlace<T>& p, const SplineSums<T>& s, T affine[3]) {
  const T q = scalar<T>(0.25);
  affine[0] = fma(p.apic[0], s.sww, q * s.dww);
  affine[1] = fma(p.apic[1], s.wsw, q * s.wdw);
  affine[2] = fma(p.apic[2], s.wws, q * s.wwd);
}

template <class T>
HWY_INLINE Transferred<T> transferred(const CellPlace<T>& p, const SplineSums<T>& s) {
  const T q = scalar<T>(0.25);
  const T* c = p.apic;
  const T* e = p.slope;
  return {s.www,
          {s.dww, s.wdw, s.wwd},
          {{e[0] * s.sww, fma(c[0], s.sdw, q * s.ddw), fma(c[0], s.swd, q * s.dwd)},
           {fma(c[1], s.dsw, q * s.ddw), e[1] * s.wsw, fma(c[1], s.wsd, q * s.wdd)},
           {fma(c[2], s.dws, q * s.dwd), fma(c[2], s.wds, q * s.wdd), e[2] * s.wws}}};
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
