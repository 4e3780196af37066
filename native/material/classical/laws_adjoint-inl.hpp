// SPDX-License-Identifier: GPL-3.0-or-later
// Adjoints of the laws of laws-inl.hpp, by hand: from the cotangents of what a law gives to those
// of what it takes. The cotangent of a symmetric tensor is the symmetric tensor X with dL = X : dτ,
// all nine entries counted. Names end in _bar.
//
// A law on Hencky strains is a pair of isotropic functions of FᵀF. In its eigenvectors the diagonal
// of the cotangent goes through the eigenvalues; off the diagonal stand the divided differences
// (φᵢ − φⱼ)/(eᵢ − eⱼ), taken in a form that has no difference left where eigenvalues meet
// (log1p(x)/x, expm1(x)/x). Where a law has a kink (yield) the side of the forward pass counts.
// Included once per SIMD target.
#if defined(MATTERFIT_MATERIAL_LAWS_ADJOINT_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_LAWS_ADJOINT_INL_HPP
#undef MATTERFIT_MATERIAL_LAWS_ADJOINT_INL_HPP
#else
#define MATTERFIT_MATERIAL_LAWS_ADJOINT_INL_HPP
#endif

#include "material/classical/constants_adjoint.hpp"
#include "material/classical/laws-inl.hpp"
#include "math/mat3_adjoint-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class T>
using ConstantsBar = material::ConstantsAdjoint<T>;

/// Cotangents of what a law takes; sums, to which each adjoint adds. An aggregate without
/// initialisers, like all that holds lanes (math/lanes-inl.hpp): begin with {}.
template <class T>
struct PointBar {
  Mat3<T> h;  ///< of the deformation gradient
  T jm1;      ///< of J
  T mean;     ///< of J̄
  T strain;   ///< of the equivalent plastic strain before the substep
};

/// What a law gives. An adjoint that is asked for it computes it on the way, with the polar
/// decomposition or the eigenvectors that it has anyway; to rounding what the forward pass had.
template <class T>
struct LawAgain {
  Sym3<T> tau;
  Sym3<T> plastic;
};

/// Keeps a quotient by a norm finite, and its square too, where nobody is.
template <class T>
HWY_INLINE T tiny() {
  return scalar<T>(1e-15);
}

template <class T>
HWY_INLINE void stress_fixed_corotated_adjoint(const Constants<T>& c, const Mat3<T>& h, T jm1,
                                               T mean, const Sym3<T>& tau_bar, PointBar<T>& bar,
                                               ConstantsBar<T>& c_bar,
                                               LawAgain<T>* again = nullptr) {
  const Mat3<T> f = plus_identity(h);
  const Mat3<T> r = polar_rotation(f);
  if (again != nullptr) again->tau = stress_fixed_corotated(c, f, r, jm1, mean);
  const T two_mu = T(c.mu + c.mu);
  // τ = 2μ (F Fᵀ − R Fᵀ) + …, R Fᵀ symmetric.
  const Mat3<T> tf = multiply(tau_bar, f);
  const Mat3<T> tr = multiply(tau_bar, r);
  Mat3<T> r_bar;
  T of_mu = scalar<T>(0);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      bar.h[i][j] += two_mu * (tf[i][j] + tf[i][j] - tr[i][j]);
      r_bar[i][j] = -two_mu * tf[i][j];
      of_mu = fma(tf[i][j], f[i][j] - r[i][j], of_mu);
    }
  c_bar.mu += of_mu + of_mu;
  add_polar_adjoint(f, r, r_bar, bar.h);
  const T j = jm1 + scalar<T>(1);
  const T trace = tau_bar.xx + tau_bar.yy + tau_bar.zz;
  bar.mean += trace * T(c.lambda) * j;
  bar.jm1 += trace * T(c.lambda) * mean;
  c_bar.lambda += trace * mean * j;
}

template <class T>
HWY_INLINE void stress_neo_hookean_adjoint(const Constants<T>& c, const Mat3<T>& h, T jm1, T mean,
                                           const Sym3<T>& tau_bar, PointBar<T>& bar,
                                           ConstantsBar<T>& c_bar) {
  const Sym3<T> b = left_cauchy_green_minus_identity(h);
  const T j = jm1 + scalar<T>(1);
  const T trace = tau_bar.xx + tau_bar.yy + tau_bar.zz;
  Sym3<T> b_bar;
  if (c.split) {
    const T iso = power(jm1, -2.0 / 3.0);
    const Sym3<T> dev_bar = deviator(tau_bar);
    const T along = contract(dev_bar, b);
    b_bar = scaled(dev_bar, T(c.mu) * iso);
    c_bar.mu += iso * along;
    bar.jm1 += scalar<T>(-2.0 / 3.0) * T(c.mu) * iso / j * along;
    bar.jm1 += trace * T(c.kappa) * mean;
    bar.mean += trace * T(c.kappa) * j;
    c_bar.kappa += trace * mean * j;
  } else {
    b_bar = scaled(tau_bar, T(c.mu));
    c_bar.mu += contract(tau_bar, b);
    const T inverse = scalar<T>(1) / (mean + scalar<T>(1));
    const T log_mean = log1p(mean);
    c_bar.lambda += trace * log_mean * j * inverse;
    bar.jm1 += trace * T(c.lambda) * log_mean * inverse;
    bar.mean += trace * T(c.lambda) * j * (scalar<T>(1) - log_mean) * inverse * inverse;
  }
  add_twice(multiply(b_bar, plus_identity(h)), bar.h);
}

template <class T>
HWY_INLINE void stress_newtonian_adjoint(const Constants<T>& c, T jm1, const Sym3<T>& tau_bar,
                                         PointBar<T>& bar, ConstantsBar<T>& c_bar) {
  const T trace = tau_bar.xx + tau_bar.yy + tau_bar.zz;
  const T log_j = log1p(jm1);
  const T j7 = exp(scalar<T>(-7) * log_j);
  const T seventh = scalar<T>(1.0 / 7.0) * trace;
  bar.jm1 += seventh * T(c.kappa) * (scalar<T>(1) + scalar<T>(6) * j7);
  c_bar.kappa += seventh * (jm1 - expm1_small(scalar<T>(-6) * log_j));
}

/// The plastic part of stress_hencky between the strains and what is kept of them.
template <class T>
struct HenckyReturn {
  T norm;       ///< |dev ε| of the trial
  T trace;      ///< tr ε of the trial
  T stretch;    ///< tr(b)/3
  T keep;       ///< factor of dev ε
  T new_trace;  ///< tr ε after the return
};

/// Cotangents of HenckyReturn's entries: of norm, trace and stretch these are results.
template <class T>
struct HenckyReturnBar {
  T norm, trace, stretch, keep, new_trace;
};

template <class T>
HWY_INLINE void von_mises_adjoint(const Constants<T>& c, const HenckyReturn<T>& state, T strain,
                                  T strain_bar, HenckyReturnBar<T>& bar, PointBar<T>& point,
                                  ConstantsBar<T>& c_bar) {
  const T zero = scalar<T>(0);
  const T c0 = scalar<T>(0.816496580927726);
  const T two_mu = T(c.mu + c.mu);
  const T stiffness = two_mu + scalar<T>(2.0 / 3.0) * T(c.hardening);
  const T y = fma(two_mu, state.norm, -(T(c.yield) + c0 * T(c.hardening) * strain));
  const auto flows = y > zero;
  const T gamma = max(y, zero) / stiffness;
  const T inverse = scalar<T>(1) / max(state.norm, tiny<T>());
  const auto partly = gamma * inverse < scalar<T>(1);
  const T keep_bar = select(partly, bar.keep, zero);
  const T gamma_bar = select(flows, fma(c0, strain_bar, -keep_bar * inverse), zero);
  const T y_bar = gamma_bar / stiffness;
  const T stiffness_bar = -gamma_bar * gamma / stiffness;
  bar.norm += keep_bar * gamma * inverse * inverse + two_mu * y_bar;
  c_bar.mu += scalar<T>(2) * (stiffness_bar + state.norm * y_bar);
  c_bar.hardening += scalar<T>(2.0 / 3.0) * stiffness_bar - c0 * strain * y_bar;
  c_bar.yield -= y_bar;
  point.strain -= c0 * T(c.hardening) * y_bar;
}

template <class T>
HWY_INLINE void herschel_bulkley_adjoint(const Constants<T>& c, const HenckyReturn<T>& state, T dt,
                                         T strain_bar, HenckyReturnBar<T>& bar,
                                         ConstantsBar<T>& c_bar) {
  using S = typename LaneTraits<T>::Scalar;
  const T zero = scalar<T>(0);
  const T one = scalar<T>(1);
  const T c0 = scalar<T>(0.816496580927726);
  const T two_mu = T(c.mu + c.mu);
  const T s = two_mu * state.norm;
  const T excess = max(s - T(c.yield), zero);
  const auto flows = excess > zero;
  const T k = two_mu * state.stretch * dt;
  // Stress left above yield x: x + k (x/η)^(1/n) = excess.
  T of_excess = zero;
  T of_k = zero;
  T of_eta = zero;
  T of_exponent = zero;
  T left = zero;
  if (c.eta > S(0)) {
    left = flow_herschel_bulkley<T>(c, excess, k);
    const T p = T(S(1) / c.exponent);
    const T log_ratio = log(max(left / T(c.eta), scalar<T>(1e-30)));
    const T rate = exp(p * log_ratio);
    const T slope = one / (one + k * p * rate / max(left, tiny<T>()));
    of_excess = slope;
    of_k = -rate * slope;
    of_eta = k * p * rate / T(c.eta) * slope;
    of_exponent = k * rate * log_ratio * p * p * slope;
  } else {  // x = η (excess/k)ⁿ while η is small
    of_eta = exp(T(c.exponent) * log(max(excess, tiny<T>()) / max(k, tiny<T>())));
  }
  const T drop = select(flows, excess - left, zero);
  const T inverse = one / max(s, tiny<T>());
  const T keep_bar = select(drop * inverse < one, bar.keep, zero);
  T drop_bar = fma(c0 / two_mu, strain_bar, -keep_bar * inverse);
  drop_bar = select(flows, drop_bar, zero);
  const T excess_bar = drop_bar * (one - of_excess);
  const T k_bar = -drop_bar * of_k;
  c_bar.eta -= drop_bar * of_eta;
  c_bar.exponent -= drop_bar * of_exponent;
  c_bar.yield -= excess_bar;
  const T s_bar = fma(keep_bar * drop, inverse * inverse, excess_bar);
  bar.norm += two_mu * s_bar;
  bar.stretch += k_bar * two_mu * dt;
  const T two_mu_bar =
      state.norm * s_bar + k_bar * state.stretch * dt - strain_bar * c0 * drop / (two_mu * two_mu);
  c_bar.mu += two_mu_bar + two_mu_bar;
}

template <class T>
HWY_INLINE void drucker_prager_adjoint(const Constants<T>& c, const HenckyReturn<T>& state,
                                       T strain_bar, HenckyReturnBar<T>& bar,
                                       ConstantsBar<T>& c_bar) {
  const T zero = scalar<T>(0);
  const T one = scalar<T>(1);
  const T c0 = scalar<T>(0.816496580927726);
  const T two_mu = T(c.mu + c.mu);
  const auto beyond_tip = state.trace - scalar<T>(3) * T(c.tip) > zero;
  c_bar.tip += select(beyond_tip, scalar<T>(3) * bar.new_trace, zero);
  bar.trace += select(beyond_tip, zero, bar.new_trace);
  const T ratio = T((c.lambda * 3 + c.mu * 2) / (c.mu * 2));
  const T cone = T(c.alpha) * state.trace - scalar<T>(3) * T(c.alpha_tip);
  const T gamma = state.norm + ratio * cone;
  const T inverse = one / max(state.norm, tiny<T>());
  bar.norm += c0 * strain_bar * (one - state.keep);
  T keep_bar = bar.keep - c0 * strain_bar * state.norm;
  keep_bar = select(beyond_tip, zero, keep_bar);
  keep_bar = select(gamma > zero, keep_bar, zero);
  keep_bar = select(gamma * inverse < one, keep_bar, zero);
  const T gamma_bar = -keep_bar * inverse;
  bar.norm += fma(keep_bar * gamma, inverse * inverse, gamma_bar);
  const T ratio_bar = gamma_bar * cone;
  c_bar.lambda += scalar<T>(3) / two_mu * ratio_bar;
  c_bar.mu -= scalar<T>(6) * T(c.lambda) / (two_mu * two_mu) * ratio_bar;
  bar.trace += gamma_bar * ratio * T(c.alpha);
  c_bar.alpha += gamma_bar * ratio * state.trace;
  c_bar.alpha_tip -= scalar<T>(3) * gamma_bar * ratio;
}

/// Adjoint of stress_neural.
template <class T>
HWY_NOINLINE void stress_neural_adjoint(const Constants<T>& c, const Mat3<T>& h, const T& jm1,
                                        const T& mean, const T& dt, const T& strain,
                                        const Sym3<T>& tau_bar, const Sym3<T>& plastic_bar,
                                        const T& strain_bar, PointBar<T>& bar,
                                        ConstantsBar<T>& c_bar, LawAgain<T>* again) {
  IsotropicBar<T> own{};
  isotropic_stress_adjoint<T>(c.neural, h, jm1, c.own_volume ? jm1 : mean, dt, strain, tau_bar,
                              plastic_bar, strain_bar, own, c_bar.neural,
                              again == nullptr ? nullptr : &again->tau,
                              again == nullptr ? nullptr : &again->plastic);
  add(own.h, bar.h);
  bar.strain += own.strain;
  if (c.own_volume) {
    bar.jm1 += own.jm1 + own.mean;
  } else {
    bar.jm1 += own.jm1;
    bar.mean += own.mean;
  }
}

/// Adjoint of stress_hencky; `strain` is the one before the substep, `plastic_bar` and `strain_bar`
/// are the cotangents of what it gives besides τ.
template <class T>
HWY_INLINE void stress_hencky_adjoint(const Constants<T>& c, const Mat3<T>& h, T jm1, T mean, T dt,
                                      T strain, const Sym3<T>& tau_bar, const Sym3<T>& plastic_bar,
                                      T strain_bar, PointBar<T>& bar, ConstantsBar<T>& c_bar,
                                      LawAgain<T>* again = nullptr) {
  if (c.law == Law::kNeuralIsotropic) {
    stress_neural_adjoint<T>(c, h, jm1, mean, dt, strain, tau_bar, plastic_bar, strain_bar, bar,
                             c_bar, again);
    return;
  }
  const T zero = scalar<T>(0);
  const T one = scalar<T>(1);
  const T third = scalar<T>(1.0 / 3.0);
  T e[3];
  Mat3<T> v;
  eigen_symmetric(right_cauchy_green_minus_identity(h), e, v);
  T eps[3];
  T inverse[3];  // 1/(1 + e)
  for (int i = 0; i < 3; ++i) {
    e[i] = max(e[i], scalar<T>(-0.999999));
    eps[i] = scalar<T>(0.5) * log1p(e[i]);
    inverse[i] = one / (one + e[i]);
  }
  HenckyReturn<T> state;
  state.trace = eps[0] + eps[1] + eps[2];
  state.stretch = one + third * (e[0] + e[1] + e[2]);
  T dev[3];
  for (int i = 0; i < 3; ++i) dev[i] = eps[i] - third * state.trace;
  state.norm = sqrt(fma(dev[0], dev[0], fma(dev[1], dev[1], dev[2] * dev[2])));
  T after = strain;
  hencky_return<T>(c, state.norm, state.trace, state.stretch, dt, after, state.keep,
                   state.new_trace);
  const T two_mu = T(c.mu + c.mu);
  const T spread = two_mu * state.keep;
  const bool own_volume = c.own_volume;
  const T log_mean = log1p(mean);
  const T inverse_mean = one / (mean + one);
  const T j = jm1 + one;
  const T ln_volume = own_volume ? state.new_trace : log_mean * j * inverse_mean;
  const T level = T(c.kappa) * ln_volume;
  T phi[3];
  for (int i = 0; i < 3; ++i) phi[i] = fma(spread, dev[i], level) * inverse[i];

  // τ = F S Fᵀ.
  const Mat3<T> f = plus_identity(h);
  const Sym3<T> s = from_eigen(v, phi);
  if (again != nullptr) again->tau = push_forward(f, s);
  const Mat3<T> tf = multiply(tau_bar, f);
  add_twice(multiply(tf, s), bar.h);
  const Mat3<T> s_bar = rotate_back(v, transpose_multiply(f, tf));
  Mat3<T> g_bar{};
  T growth[3] = {zero, zero, zero};
  const T less = state.keep - one;
  const T volume_step = third * (state.new_trace - state.trace);
  if (c.plastic) {
    g_bar = rotate_back(v, to_matrix(plastic_bar));
    for (int i = 0; i < 3; ++i) growth[i] = expm1_small(fma(less, dev[i], volume_step));
    if (again != nullptr) again->plastic = from_eigen(v, growth);
  }

  // Off the diagonal.
  Mat3<T> e_bar;
  for (int i = 0; i < 3; ++i)
    for (int k = i + 1; k < 3; ++k) {
      // ½ (ln(1+eᵢ) − ln(1+eₖ))/(eᵢ − eₖ).
      const T quotient = scalar<T>(0.5) * log1p_over((e[i] - e[k]) * inverse[k]) * inverse[k];
      const T both = inverse[i] * inverse[k];
      const T stress = fma(spread, quotient * inverse[i] - dev[k] * both, -level * both);
      T sum = stress * s_bar[i][k];
      if (c.plastic) {
        const T flow = (one + growth[k]) * expm1_over(less * (eps[i] - eps[k])) * less * quotient;
        sum = fma(flow, g_bar[i][k], sum);
      }
      e_bar[i][k] = e_bar[k][i] = sum;
    }

  // On it.
  HenckyReturnBar<T> flow_bar{};
  T dev_bar[3];
  T spread_bar = zero;
  T level_bar = zero;
  for (int i = 0; i < 3; ++i) {
    const T weighted = s_bar[i][i] * inverse[i];
    spread_bar = fma(weighted, dev[i], spread_bar);
    level_bar += weighted;
    dev_bar[i] = spread * weighted;
    e_bar[i][i] = -phi[i] * weighted;
  }
  flow_bar.keep = two_mu * spread_bar;
  c_bar.mu += scalar<T>(2) * state.keep * spread_bar;
  c_bar.kappa += ln_volume * level_bar;
  const T volume_bar = T(c.kappa) * level_bar;
  if (own_volume) {
    flow_bar.new_trace += volume_bar;
  } else {
    bar.jm1 += volume_bar * log_mean * inverse_mean;
    bar.mean += volume_bar * j * (one - log_mean) * inverse_mean * inverse_mean;
  }
  if (c.plastic) {
    for (int i = 0; i < 3; ++i) {
      const T x_bar = g_bar[i][i] * (one + growth[i]);
      flow_bar.keep = fma(x_bar, dev[i], flow_bar.keep);
      dev_bar[i] = fma(less, x_bar, dev_bar[i]);
      flow_bar.new_trace = fma(third, x_bar, flow_bar.new_trace);
      flow_bar.trace = fma(-third, x_bar, flow_bar.trace);
    }
    bar.strain += strain_bar;
  }
  switch (c.law) {
    case Law::kVonMises:
      von_mises_adjoint(c, state, strain, strain_bar, flow_bar, bar, c_bar);
      flow_bar.trace += flow_bar.new_trace;
      break;
    case Law::kHerschelBulkley:
      herschel_bulkley_adjoint(c, state, dt, strain_bar, flow_bar, c_bar);
      flow_bar.trace += flow_bar.new_trace;
      break;
    case Law::kDruckerPrager:
      drucker_prager_adjoint(c, state, strain_bar, flow_bar, c_bar);
      break;
    case Law::kFixedCorotated:
    case Law::kNeoHookean:
    case Law::kStvkHencky:
    case Law::kNewtonian:
    case Law::kNeuralIsotropic:
    case Law::kLatent:
    case Law::kPublished:
      flow_bar.trace += flow_bar.new_trace;
      break;
  }
  const T along_norm = flow_bar.norm / max(state.norm, tiny<T>());
  for (int i = 0; i < 3; ++i) dev_bar[i] = fma(along_norm, dev[i], dev_bar[i]);
  const T shift = flow_bar.trace - third * (dev_bar[0] + dev_bar[1] + dev_bar[2]);
  for (int i = 0; i < 3; ++i) {
    e_bar[i][i] += scalar<T>(0.5) * inverse[i] * (dev_bar[i] + shift) + third * flow_bar.stretch;
  }
  // e of FᵀF − I.
  add_twice(multiply(f, rotate_forth(v, e_bar)), bar.h);
}

/// Adjoint of kirchhoff_stress: adds to `bar` and `c_bar`; sets `again`, if not null.
template <StressFamily kFamily, class T>
HWY_INLINE void kirchhoff_stress_adjoint(const Constants<T>& c, const Mat3<T>& h, T jm1, T mean,
                                         T dt, T strain, const Sym3<T>& tau_bar,
                                         const Sym3<T>& plastic_bar, T strain_bar, PointBar<T>& bar,
                                         ConstantsBar<T>& c_bar, LawAgain<T>* again = nullptr) {
  if constexpr (kFamily == StressFamily::kFixedCorotated) {
    stress_fixed_corotated_adjoint(c, h, jm1, mean, tau_bar, bar, c_bar, again);
  } else if constexpr (kFamily == StressFamily::kNeoHookean) {
    stress_neo_hookean_adjoint(c, h, jm1, mean, tau_bar, bar, c_bar);
    if (again != nullptr) again->tau = stress_neo_hookean(c, h, jm1, mean);
  } else if constexpr (kFamily == StressFamily::kNewtonian) {
    stress_newtonian_adjoint(c, jm1, tau_bar, bar, c_bar);
    if (again != nullptr) again->tau = stress_newtonian(c, jm1);
  } else if constexpr (kFamily == StressFamily::kHencky) {
    stress_hencky_adjoint(c, h, jm1, mean, dt, strain, tau_bar, plastic_bar, strain_bar, bar, c_bar,
                          again);
  } else {
    using Added = AddedStress<kFamily>;
    Added::template adjoint<T>(c, h, jm1, mean, dt, strain, tau_bar, plastic_bar, strain_bar, bar,
                               c_bar);
    if (again != nullptr) {
      again->tau = Added::template stress<T>(c, h, jm1, mean, dt, again->plastic, strain);
    }
  }
}

template <class T>
HWY_INLINE void crush_pressure_adjoint(const Constants<T>& c, T jm1, const Sym3<T>& tau_bar,
                                       PointBar<T>& bar, ConstantsBar<T>& c_bar) {
  const T zero = scalar<T>(0);
  const T j = max(jm1 + scalar<T>(1), scalar<T>(1e-6));
  const auto crushed = scalar<T>(kCrushRatio) - j > zero;
  if (none(crushed, j)) return;
  const T ratio = scalar<T>(kCrushRatio) / j;
  const T trace = select(crushed, tau_bar.xx + tau_bar.yy + tau_bar.zz, zero);
  const T of_modulus = -trace * (ratio * ratio - scalar<T>(1));
  bar.jm1 += trace * T(c.lambda + c.mu + c.mu) * scalar<T>(2) * ratio * ratio / j;
  c_bar.lambda += of_modulus;
  c_bar.mu += of_modulus + of_modulus;
}

/// Adjoint of add_viscous_stress: adds to `l_bar`, `bar` and `c_bar`.
template <class T>
HWY_INLINE void viscous_stress_adjoint(const Constants<T>& c, const Mat3<T>& l, T jm1,
                                       const Sym3<T>& tau_bar, Mat3<T>& l_bar, PointBar<T>& bar,
                                       ConstantsBar<T>& c_bar) {
  using S = typename LaneTraits<T>::Scalar;
  const T j = jm1 + scalar<T>(1);
  const T shear = T(c.damping_shear + (c.fluid ? c.eta : S(0)));
  const T bulk = T(c.damping_bulk - c.damping_shear * S(2.0 / 3.0));
  const T trace = l[0][0] + l[1][1] + l[2][2];
  const T trace_bar = tau_bar.xx + tau_bar.yy + tau_bar.zz;
  const Mat3<T> t = to_matrix(tau_bar);
  T along = scalar<T>(0);  // τ̄ : 2D
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) {
      along = fma(t[i][k], l[i][k] + l[i][k], along);
      l_bar[i][k] += scalar<T>(2) * shear * j * t[i][k];
    }
  for (int i = 0; i < 3; ++i) l_bar[i][i] += bulk * j * trace_bar;
  const T both = trace * trace_bar;
  bar.jm1 += fma(shear, along, bulk * both);
  c_bar.damping_shear += j * fma(scalar<T>(-2.0 / 3.0), both, along);
  c_bar.damping_bulk += j * both;
  if (c.fluid) c_bar.eta += j * along;
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
