// SPDX-License-Identifier: GPL-3.0-or-later
// Adjoints of maxwell-inl.hpp, by hand, in the conventions of laws_adjoint-inl.hpp. Included once
// per SIMD target.
#if defined(MATTERFIT_MATERIAL_MAXWELL_ADJOINT_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_MAXWELL_ADJOINT_INL_HPP
#undef MATTERFIT_MATERIAL_MAXWELL_ADJOINT_INL_HPP
#else
#define MATTERFIT_MATERIAL_MAXWELL_ADJOINT_INL_HPP
#endif

#include "material/classical/laws_adjoint-inl.hpp"
#include "material/classical/maxwell-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Cotangents of a MaxwellStep; sums.
template <class T>
struct MaxwellStepBar {
  T stiffness;
  T relaxed;
};

/// Adjoint of isochoric_inverse_minus_identity.
template <class T>
HWY_INLINE void isochoric_inverse_adjoint(const Mat3<T>& h, T jm1, const Sym3<T>& rest_bar,
                                          PointBar<T>& bar) {
  const Mat3<T> f = plus_identity(h);
  const Mat3<T> k = cofactor(f);
  const T inverse_j2 = scalar<T>(1) / ((jm1 + scalar<T>(1)) * (jm1 + scalar<T>(1)));
  const Sym3<T> inverse = scaled(symmetric_part(transpose_multiply(k, k)), inverse_j2);  // C⁻¹
  const T iso = power(jm1, 2.0 / 3.0);
  bar.jm1 += scalar<T>(2.0 / 3.0) * iso / (jm1 + scalar<T>(1)) * contract(rest_bar, inverse);
  const Mat3<T> c_bar = multiply(multiply(inverse, to_matrix(rest_bar)), inverse);
  add_scaled(multiply(f, c_bar), scalar<T>(-2) * iso, bar.h);
}

/// Adjoint of add_maxwell_stress with `commit`: `history` is the one before the substep, of which
/// G − I counts; `g_bar` holds per branch the cotangent of G after the substep, and gets that of
/// the one before. `steps_bar` are sums.
template <class T>
HWY_INLINE void maxwell_stress_adjoint(
    const Constants<T>& c,
    const MaxwellStep<typename LaneTraits<T>::Scalar> steps[material::kMostMaxwellBranches],
    const Mat3<T>& h, T jm1, const typename LaneTraits<T>::Scalar* history, std::size_t stride,
    const Sym3<T>& tau_bar, Sym3<T>* g_bar, PointBar<T>& bar, MaxwellStepBar<T>* steps_bar) {
  const Mat3<T> f = plus_identity(h);
  const Sym3<T> b = left_cauchy_green_minus_identity(h);
  const Sym3<T> rest = isochoric_inverse_minus_identity(h, jm1);
  const T iso = power(jm1, -2.0 / 3.0);
  const Sym3<T> dev_bar = deviator(tau_bar);
  const Mat3<T> df = multiply(dev_bar, f);
  Sym3<T> rest_bar{};
  T iso_bar = scalar<T>(0);
  for (std::size_t i = 0; i < c.maxwell_count; ++i) {
    const Sym3<T> g = load_sym3<T>(history + i * 12 * stride, stride);
    const T stiffness = T(steps[i].stiffness);
    const T share = T(steps[i].relaxed);
    const T along = contract(dev_bar, sum(b, push_forward(f, g)));
    steps_bar[i].stiffness += iso * along;
    iso_bar = fma(stiffness, along, iso_bar);
    const T factor = stiffness * iso;
    add_scaled(multiply(df, add_diagonal(g, scalar<T>(1))), factor + factor, bar.h);
    steps_bar[i].relaxed += contract(g_bar[i], sum(rest, scaled(g, scalar<T>(-1))));
    rest_bar = sum(rest_bar, scaled(g_bar[i], share));
    g_bar[i] = sum(scaled(g_bar[i], scalar<T>(1) - share),
                   scaled(symmetric_part(transpose_multiply(f, df)), factor));
  }
  bar.jm1 += scalar<T>(-2.0 / 3.0) * iso / (jm1 + scalar<T>(1)) * iso_bar;
  isochoric_inverse_adjoint(h, jm1, rest_bar, bar);
}

/// Adjoint of carry_maxwell: `next_bar` is the cotangent of what it returns; the result that of
/// `a`.
template <class T>
HWY_INLINE Sym3<T> carry_maxwell_adjoint(MaxwellStep<typename LaneTraits<T>::Scalar> over,
                                         const Mat3<T>& step, const Sym3<T>& a,
                                         const Sym3<T>& tau_bar, const Sym3<T>& next_bar,
                                         Mat3<T>& step_bar, MaxwellStepBar<T>& over_bar) {
  const Mat3<T> f = plus_identity(step);
  const T det_m1 = determinant_minus_one(step);
  const T iso_m1 = expm1_small(scalar<T>(-2.0 / 3.0) * log1p(det_m1));
  const T iso = iso_m1 + scalar<T>(1);
  const Sym3<T> whole = add_diagonal(a, scalar<T>(1));
  const Sym3<T> moved = push_forward(f, whole);
  const Sym3<T> trial = add_diagonal(
      scaled(sum(left_cauchy_green_minus_identity(step), push_forward(f, a)), iso), iso_m1);
  const Sym3<T> dev_bar = deviator(tau_bar);
  over_bar.stiffness += contract(dev_bar, trial);
  over_bar.relaxed -= contract(next_bar, trial);
  const Sym3<T> trial_bar =
      sum(scaled(dev_bar, T(over.stiffness)), scaled(next_bar, scalar<T>(1) - T(over.relaxed)));
  const Mat3<T> tf = multiply(trial_bar, f);
  add_scaled(multiply(tf, whole), iso + iso, step_bar);
  const T of_volume =
      scalar<T>(-2.0 / 3.0) * iso / (det_m1 + scalar<T>(1)) * contract(trial_bar, moved);
  add_scaled(cofactor(f), of_volume, step_bar);
  return scaled(symmetric_part(transpose_multiply(f, tf)), iso);
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
