// SPDX-License-Identifier: GPL-3.0-or-later
// Maxwell branches beside any law: a neo-Hookean spring in series with a dashpot, whose rest shape
// follows the body's with a relaxation time t (Lubliner 1985, Mech. Res. Comm. 12; in rates this is
// the upper-convected Maxwell model). With G the inverse of the dashpot's right Cauchy–Green tensor
// and C̄ = J^(−2/3) FᵀF,
//   Ġ = (C̄⁻¹ − G)/t,   τ = m dev(F̄ G F̄ᵀ),   F̄ = J^(−1/3) F.
// It dissipates for any motion, and t → 0 at constant m t is the damping η_s = m t.
//
// Over a substep the strain is held and the relaxation exact, G ← e^(−a) G + (1 − e^(−a)) C̄⁻¹ with
// a = dt/t. C̄⁻¹ itself has no stress; that of the old G is taken (1 − e^(−a))/a times, its mean
// over the substep. This makes the scheme second order, and exact at a steady rate for any a: a
// branch that is faster than the substep is the damping m t. Included once per SIMD target.
#if defined(MATTERFIT_MATERIAL_MAXWELL_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_MAXWELL_INL_HPP
#undef MATTERFIT_MATERIAL_MAXWELL_INL_HPP
#else
#define MATTERFIT_MATERIAL_MAXWELL_INL_HPP
#endif

#include "material/classical/laws-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// A branch over one substep.
template <class S>
struct MaxwellStep {
  S stiffness;  ///< m (1 − e^(−a))/a [Pa]
  S relaxed;    ///< 1 − e^(−dt/t)
};

template <class S>
void maxwell_steps(const material::LawConstants<S>& c, S dt,
                   MaxwellStep<S> steps[material::kMostMaxwellBranches]) {
  for (std::size_t i = 0; i < c.maxwell_count; ++i) {
    const double a = static_cast<double>(dt) / static_cast<double>(c.maxwell[i].time);
    const double relaxed = -std::expm1(-a);
    steps[i].relaxed = static_cast<S>(relaxed);
    steps[i].stiffness = static_cast<S>(static_cast<double>(c.maxwell[i].modulus) * relaxed / a);
  }
}

template <class T>
HWY_INLINE Sym3<T> load_sym3(const typename LaneTraits<T>::Scalar* p, std::size_t stride) {
  return {LaneTraits<T>::load(p),
          LaneTraits<T>::load(p + stride),
          LaneTraits<T>::load(p + 2 * stride),
          LaneTraits<T>::load(p + 3 * stride),
          LaneTraits<T>::load(p + 4 * stride),
          LaneTraits<T>::load(p + 5 * stride)};
}

template <class T>
HWY_INLINE void store_sym3(const Sym3<T>& s, typename LaneTraits<T>::Scalar* p,
                           std::size_t stride) {
  const T values[6] = {s.xx, s.yy, s.zz, s.yz, s.xz, s.xy};
  for (std::size_t i = 0; i < 6; ++i) LaneTraits<T>::store(values[i], p + i * stride);
}

/// C̄⁻¹ − I = J^(2/3) (FᵀF)⁻¹ − I of F = I + `h`, small strains with their digits.
template <class T>
HWY_INLINE Sym3<T> isochoric_inverse_minus_identity(const Mat3<T>& h, T jm1) {
  const Mat3<T> k = cofactor(plus_identity(h));
  const T inverse_j2 = scalar<T>(1) / ((jm1 + scalar<T>(1)) * (jm1 + scalar<T>(1)));
  // (FᵀF)⁻¹ = kᵀk/J², and (FᵀF)⁻¹ − I = −(FᵀF)⁻¹ (FᵀF − I).
  const auto inverse = [&](int i, int j) {
    return inverse_j2 * fma(k[0][i], k[0][j], fma(k[1][i], k[1][j], k[2][i] * k[2][j]));
  };
  const Sym3<T> a{inverse(0, 0), inverse(1, 1), inverse(2, 2),
                  inverse(1, 2), inverse(0, 2), inverse(0, 1)};
  const Sym3<T> c = right_cauchy_green_minus_identity(h);
  const T growth = expm1_small(scalar<T>(2.0 / 3.0) * log1p(jm1));
  const T factor = -(growth + scalar<T>(1));
  const auto row = [&](T x, T y, T z, T p, T q, T r) { return fma(x, p, fma(y, q, z * r)); };
  const Sym3<T> product{
      row(a.xx, a.xy, a.xz, c.xx, c.xy, c.xz), row(a.xy, a.yy, a.yz, c.xy, c.yy, c.yz),
      row(a.xz, a.yz, a.zz, c.xz, c.yz, c.zz), row(a.xy, a.yy, a.yz, c.xz, c.yz, c.zz),
      row(a.xx, a.xy, a.xz, c.xz, c.yz, c.zz), row(a.xx, a.xy, a.xz, c.xy, c.yy, c.yz)};
  return add_diagonal(scaled(product, factor), growth);
}

/// Total Lagrangian: adds the branches' stress of I + `h` to `tau`. `history` holds, per branch and
/// `stride` apart, G − I (6) and what rounding took from it (6): relaxation over one substep is
/// often less than a float's last digit. `commit`: G relaxes over the substep.
template <class T>
HWY_INLINE void add_maxwell_stress(
    const Constants<T>& c,
    const MaxwellStep<typename LaneTraits<T>::Scalar> steps[material::kMostMaxwellBranches],
    const Mat3<T>& h, T jm1, bool commit, typename LaneTraits<T>::Scalar* history,
    std::size_t stride, Sym3<T>& tau) {
  const Mat3<T> f = plus_identity(h);
  const Sym3<T> b = left_cauchy_green_minus_identity(h);
  const T isochoric = power(jm1, -2.0 / 3.0);
  Sym3<T> rest{};
  if (commit) rest = isochoric_inverse_minus_identity(h, jm1);
  for (std::size_t i = 0; i < c.maxwell_count; ++i) {
    typename LaneTraits<T>::Scalar* at = history + i * 12 * stride;
    const Sym3<T> g = load_sym3<T>(at, stride);
    const T stiffness = T(commit ? steps[i].stiffness : c.maxwell[i].modulus);
    tau = sum(tau, scaled(deviator(sum(b, push_forward(f, g))), stiffness * isochoric));
    if (!commit) continue;
    // Compensated: g + relaxed (rest − g).
    const T share = T(steps[i].relaxed);
    const Sym3<T> lost = load_sym3<T>(at + 6 * stride, stride);
    const Sym3<T> step = sum(scaled(sum(rest, scaled(g, scalar<T>(-1))), share), lost);
    const Sym3<T> next = sum(g, step);
    store_sym3(next, at, stride);
    store_sym3(sum(step, scaled(sum(next, scaled(g, scalar<T>(-1))), scalar<T>(-1))),
               at + 6 * stride, stride);
  }
}

/// Updated Lagrangian: `a` is F̄ G F̄ᵀ − I, carried along by the substep's I + `step` = I + dt C,
/// then relaxed; its stress is added to `tau`.
template <class T>
HWY_INLINE Sym3<T> carry_maxwell(MaxwellStep<typename LaneTraits<T>::Scalar> over,
                                 const Mat3<T>& step, const Sym3<T>& a, Sym3<T>& tau) {
  const T isochoric_m1 = expm1_small(scalar<T>(-2.0 / 3.0) * log1p(determinant_minus_one(step)));
  const Sym3<T> moved =
      sum(left_cauchy_green_minus_identity(step), push_forward(plus_identity(step), a));
  const Sym3<T> trial = add_diagonal(scaled(moved, isochoric_m1 + scalar<T>(1)), isochoric_m1);
  tau = sum(tau, scaled(deviator(trial), T(over.stiffness)));
  using S = typename LaneTraits<T>::Scalar;
  return scaled(trial, T(S(1) - over.relaxed));
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
