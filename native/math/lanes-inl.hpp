// SPDX-License-Identifier: GPL-3.0-or-later
// One vocabulary for a scalar and for a SIMD register of them, so that a formula is written once
// and runs as float or double, one particle or sixteen. Included once per SIMD target.
#if defined(MATTERFIT_MATH_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATH_LANES_INL_HPP
#undef MATTERFIT_MATH_LANES_INL_HPP
#else
#define MATTERFIT_MATH_LANES_INL_HPP
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "hwy/contrib/math/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// A register of lanes of D's type with the arithmetic of a number.
template <class D>
struct Lanes {
  using Scalar = hn::TFromD<D>;
  using Vector = hn::Vec<D>;
  using Mask = hn::Mask<D>;
  Vector v;

  // Trivial: GCC gives implicit constructors of what holds one no SIMD target of their own.
  Lanes() = default;
  HWY_INLINE Lanes(Vector vector) : v(vector) {}                // NOLINT: a number
  HWY_INLINE Lanes(Scalar scalar) : v(hn::Set(D(), scalar)) {}  // NOLINT: a number

  static HWY_INLINE Lanes load(const Scalar* p) { return hn::LoadU(D(), p); }
  HWY_INLINE void store(Scalar* p) const { hn::StoreU(v, D(), p); }

  friend HWY_INLINE Lanes operator+(Lanes a, Lanes b) { return hn::Add(a.v, b.v); }
  friend HWY_INLINE Lanes operator-(Lanes a, Lanes b) { return hn::Sub(a.v, b.v); }
  friend HWY_INLINE Lanes operator*(Lanes a, Lanes b) { return hn::Mul(a.v, b.v); }
  friend HWY_INLINE Lanes operator/(Lanes a, Lanes b) { return hn::Div(a.v, b.v); }
  friend HWY_INLINE Lanes operator-(Lanes a) { return hn::Neg(a.v); }
  HWY_INLINE Lanes& operator+=(Lanes b) { return *this = *this + b; }
  HWY_INLINE Lanes& operator-=(Lanes b) { return *this = *this - b; }
  HWY_INLINE Lanes& operator*=(Lanes b) { return *this = *this * b; }

  friend HWY_INLINE Lanes fma(Lanes a, Lanes b, Lanes c) { return hn::MulAdd(a.v, b.v, c.v); }
  friend HWY_INLINE Lanes fnma(Lanes a, Lanes b, Lanes c) { return hn::NegMulAdd(a.v, b.v, c.v); }
  friend HWY_INLINE Lanes sqrt(Lanes a) { return hn::Sqrt(a.v); }
  friend HWY_INLINE Lanes abs(Lanes a) { return hn::Abs(a.v); }
  friend HWY_INLINE Lanes min(Lanes a, Lanes b) { return hn::Min(a.v, b.v); }
  friend HWY_INLINE Lanes max(Lanes a, Lanes b) { return hn::Max(a.v, b.v); }
  friend HWY_INLINE Lanes exp(Lanes a) { return hn::Exp(D(), a.v); }
  friend HWY_INLINE Lanes log(Lanes a) { return hn::Log(D(), a.v); }
  friend HWY_INLINE Lanes log1p(Lanes a) { return hn::Log1p(D(), a.v); }
  friend HWY_INLINE Mask operator<(Lanes a, Lanes b) { return hn::Lt(a.v, b.v); }
  friend HWY_INLINE Mask operator>(Lanes a, Lanes b) { return hn::Gt(a.v, b.v); }
  friend HWY_INLINE Lanes select(Mask mask, Lanes yes, Lanes no) {
    return hn::IfThenElse(mask, yes.v, no.v);
  }
  friend HWY_INLINE bool none(Mask mask, Lanes) { return hn::AllFalse(D(), mask); }
};

HWY_INLINE float fma(float a, float b, float c) { return a * b + c; }
HWY_INLINE double fma(double a, double b, double c) { return a * b + c; }
HWY_INLINE float fnma(float a, float b, float c) { return c - a * b; }
HWY_INLINE double fnma(double a, double b, double c) { return c - a * b; }
HWY_INLINE float sqrt(float a) { return std::sqrt(a); }
HWY_INLINE double sqrt(double a) { return std::sqrt(a); }
HWY_INLINE float abs(float a) { return std::fabs(a); }
HWY_INLINE double abs(double a) { return std::fabs(a); }
HWY_INLINE float min(float a, float b) { return std::min(a, b); }
HWY_INLINE double min(double a, double b) { return std::min(a, b); }
HWY_INLINE float max(float a, float b) { return std::max(a, b); }
HWY_INLINE double max(double a, double b) { return std::max(a, b); }
HWY_INLINE float exp(float a) { return std::exp(a); }
HWY_INLINE double exp(double a) { return std::exp(a); }
HWY_INLINE float log(float a) { return std::log(a); }
HWY_INLINE double log(double a) { return std::log(a); }
HWY_INLINE float log1p(float a) { return std::log1p(a); }
HWY_INLINE double log1p(double a) { return std::log1p(a); }
HWY_INLINE float select(bool mask, float yes, float no) { return mask ? yes : no; }
HWY_INLINE double select(bool mask, double yes, double no) { return mask ? yes : no; }
HWY_INLINE bool none(bool mask, float) { return !mask; }
HWY_INLINE bool none(bool mask, double) { return !mask; }

template <class T>
struct LaneTraits {
  using Scalar = T;
  static constexpr std::size_t kCount = 1;
  static HWY_INLINE T load(const T* p) { return *p; }
  static HWY_INLINE void store(T value, T* p) { *p = value; }
};
template <class D>
struct LaneTraits<Lanes<D>> {
  using Scalar = hn::TFromD<D>;
  static constexpr std::size_t kCount = hn::MaxLanes(D());
  static HWY_INLINE Lanes<D> load(const Scalar* p) { return Lanes<D>::load(p); }
  static HWY_INLINE void store(Lanes<D> value, Scalar* p) { value.store(p); }
};

/// e^x − 1 without cancellation near 0, to rounding for |x| of any size.
template <class T>
HWY_INLINE T expm1_small(T x) {
  // Above a tenth the plain difference loses less than four bits; below, seven Taylor terms reach
  // double rounding at |x| = 0.1 within 2e-14.
  using S = typename LaneTraits<T>::Scalar;
  T series = T(S(1.0 / 40320));
  for (const double c : {1.0 / 5040, 1.0 / 720, 1.0 / 120, 1.0 / 24, 1.0 / 6, 0.5, 1.0}) {
    series = fma(series, x, T(S(c)));
  }
  return select(abs(x) < T(S(0.1)), series * x, exp(x) - T(S(1)));
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
