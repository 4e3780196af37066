// SPDX-License-Identifier: GPL-3.0-or-later
// The GELU activation x Φ(x), Φ the normal distribution (Hendrycks & Gimpel 2016), and its
// derivative: exact (to float rounding in registers, by std::erf in scalars) or a polynomial whose
// derivative is the polynomial's own. Included once per SIMD target.
#if defined(MATTERFIT_MATERIAL_NEURAL_GELU_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_NEURAL_GELU_INL_HPP
#undef MATTERFIT_MATERIAL_NEURAL_GELU_INL_HPP
#else
#define MATTERFIT_MATERIAL_NEURAL_GELU_INL_HPP
#endif

#include "math/mat3-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class T>
struct Gelu {
  T value;
  T slope;
};

HWY_INLINE float normal_cdf(float x, float) { return 0.5F * std::erfc(-x * 0.70710678F); }
HWY_INLINE double normal_cdf(double x, double) {
  return 0.5 * std::erfc(-x * 0.707106781186547524);
}
/// `gauss` = exp(−x²/2). erfc(z) exp(z²) as a polynomial in 1/(1 + 0.35 z), fitted to z ≤ 4.6 with
/// relative error 3.3e-9; beyond, the tail is below float rounding of the value.
template <class D>
HWY_INLINE Lanes<D> normal_cdf(Lanes<D> x, Lanes<D> gauss) {
  using T = Lanes<D>;
  const T t = scalar<T>(1) / fma(abs(x), scalar<T>(0.35 * 0.707106781186547524), scalar<T>(1));
  T p = scalar<T>(0.07252495619);
  for (const double c : {-0.4299985426, 0.9012105999, -0.8069829575, 0.7111593872, -0.08340710635,
                         0.249571479, 0.1878220138, 0.1981001671}) {
    p = fma(p, t, scalar<T>(c));
  }
  const T tail = scalar<T>(0.5) * p * t * gauss;
  return select(x < scalar<T>(0), tail, scalar<T>(1) - tail);
}

template <class T>
HWY_INLINE Gelu<T> gelu_exact(T x) {
  const T gauss = exp(scalar<T>(-0.5) * x * x);
  const T phi = normal_cdf(x, gauss);
  return {x * phi, fma(scalar<T>(0.398942280401432678) * x, gauss, phi)};
}

/// Φ(x) = ½ + x q(x²) for |x| < 4.2, 0 or 1 beyond, continuous; the value within 7.5e-5 of GELU,
/// the slope within 1.4e-3.
template <class T>
HWY_INLINE Gelu<T> gelu_polynomial(T x) {
  constexpr double kEnd = 4.2;
  const T t = max(min(x, scalar<T>(kEnd)), scalar<T>(-kEnd));
  const T s = t * t;
  T q = scalar<T>(-9.01752874e-10);
  T dq = q;  // of q by s, by Horner's double recurrence
  constexpr double kQ[] = {7.94133698e-08, -3.03793086e-06, 6.68906849e-05, -0.00095065741,
                           0.00929822887,  -0.065528201,    0.398465872};
  for (int i = 0; i < 7; ++i) {
    q = fma(q, s, scalar<T>(kQ[i]));
    if (i < 6) dq = fma(dq, s, q);
  }
  const T phi = fma(t, q, scalar<T>(0.5));
  const T bend = x * fma(s + s, dq, q);
  return {x * phi, phi + select(abs(x) < scalar<T>(kEnd), bend, scalar<T>(0))};
}

template <bool kExact, class T>
HWY_INLINE Gelu<T> gelu(T x) {
  if constexpr (kExact) {
    return gelu_exact(x);
  } else {
    return gelu_polynomial(x);
  }
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
