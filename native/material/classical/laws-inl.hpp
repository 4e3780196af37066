// SPDX-License-Identifier: GPL-3.0-or-later
// The classical constitutive laws: Kirchhoff stress τ and return mapping over a scalar or a
// register of lanes. Strains are taken from H = F − I, so that small ones keep their digits.
//
// Every law is isotropic; with F = U Σ Vᵀ only V and Σ² − 1 (eigenpairs of FᵀF − I) are needed:
// τ = F S Fᵀ with S = V diag(τᵢ/σᵢ²) Vᵀ. The volume term is separate: U′(J̄) of a mean J̄ gives
// τ_vol = J U′(J̄) I (variational mean dilatation); a point on its own passes its own J.
// Included once per SIMD target.
#if defined(MATTERFIT_MATERIAL_LAWS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_LAWS_INL_HPP
#undef MATTERFIT_MATERIAL_LAWS_INL_HPP
#else
#define MATTERFIT_MATERIAL_LAWS_INL_HPP
#endif

#include "material/classical/law_constants.hpp"
#include "material/neural/isotropic-inl.hpp"
#include "math/mat3-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

using material::Law;
using material::StressFamily;

template <class T>
using Constants = material::LawConstants<typename LaneTraits<T>::Scalar>;

/// J^p from J − 1.
template <class T>
HWY_INLINE T power(T j_minus_one, double p) {
  return exp(scalar<T>(p) * log1p(j_minus_one));
}

/// Fixed corotated (Stomakhin et al. 2012): τ = 2μ (F−R)Fᵀ + λ (J̄−1) J I.
template <class T>
HWY_INLINE Sym3<T> stress_fixed_corotated(const Constants<T>& c, const Mat3<T>& f, const Mat3<T>& r,
                                          T jm1, T mean) {
  Mat3<T> d;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) d[i][j] = f[i][j] - r[i][j];
  const T two_mu = T(c.mu + c.mu);
  const auto dot = [&](int i, int j) {
    return two_mu * fma(d[i][0], f[j][0], fma(d[i][1], f[j][1], d[i][2] * f[j][2]));
  };
  const T pressure = T(c.lambda) * mean * (jm1 + scalar<T>(1));
  return add_diagonal<T>({dot(0, 0), dot(1, 1), dot(2, 2), dot(1, 2), dot(0, 2), dot(0, 1)},
                         pressure);
}

/// Neo-Hookean: τ = μ (FFᵀ − I) + λ (ln J̄/J̄) J I, or split near incompressibility:
/// τ = μ J^(−2/3) dev(FFᵀ) + κ (J̄−1) J I.
template <class T>
HWY_INLINE Sym3<T> stress_neo_hookean(const Constants<T>& c, const Mat3<T>& h, T jm1, T mean) {
  Sym3<T> b = left_cauchy_green_minus_identity(h);
  const T j = jm1 + scalar<T>(1);
  T factor = T(c.mu);
  T pressure;
  if (c.split) {
    factor = factor * power(jm1, -2.0 / 3.0);
    b = add_diagonal(b, scalar<T>(-1.0 / 3.0) * (b.xx + b.yy + b.zz));
    pressure = T(c.kappa) * mean * j;
  } else {
    pressure = T(c.lambda) * log1p(mean) * j / (mean + scalar<T>(1));
  }
  return add_diagonal<T>(
      {factor * b.xx, factor * b.yy, factor * b.zz, factor * b.yz, factor * b.xz, factor * b.xy},
      pressure);
}

/// Newtonian fluid, weakly compressible: the pressure part (K/7)(J − J⁻⁶) I.
template <class T>
HWY_INLINE Sym3<T> stress_newtonian(const Constants<T>& c, T jm1) {
  const T pressure =
      T(c.kappa) * scalar<T>(1.0 / 7.0) * (jm1 - expm1_small(scalar<T>(-6) * log1p(jm1)));
  const T zero = scalar<T>(0);
  return {pressure, pressure, pressure, zero, zero, zero};
}

/// Herschel–Bulkley flow: |s| from the trial |s|, with η |γ̇|ⁿ = |s| − √(2/3) τ_Y and
/// |s_tr| − |s| = 2 μ̂ dt |γ̇|. n = 1 in closed form, else Newton's method in the variable that makes
/// the residual convex, from above, so that it descends without overshoot. It starts where one of
/// the two terms alone makes up the excess, the lower such place: there neither overflows, and the
/// root is at most a factor of two below.
template <class T>
HWY_INLINE T flow_herschel_bulkley(const Constants<T>& c, T excess, T two_mu_hat_dt) {
  using S = typename LaneTraits<T>::Scalar;
  const T eta = T(c.eta);
  if (!(c.eta > S(0))) return scalar<T>(0);
  if (c.exponent == S(1)) return excess - excess / (scalar<T>(1) + eta / two_mu_hat_dt);
  const T tiny = scalar<T>(1e-20);
  const T safe = max(excess, tiny);
  if (c.exponent < S(1)) {
    const T p = T(S(1) / c.exponent);
    T x = max(min(safe, eta * exp(T(c.exponent) * log(max(safe / two_mu_hat_dt, tiny)))), tiny);
    for (int k = 0; k < 12; ++k) {
      const T rate = exp(p * log(max(x / eta, tiny)));
      const T g = x + two_mu_hat_dt * rate - safe;
      x = max(x - g / (scalar<T>(1) + two_mu_hat_dt * p * rate / max(x, tiny)), tiny);
    }
    return x;
  }
  const T n = T(c.exponent);
  T z = min(safe / two_mu_hat_dt, exp(T(S(1) / c.exponent) * log(max(safe / eta, tiny))));
  for (int k = 0; k < 12; ++k) {
    const T stress = eta * exp(n * log(max(z, tiny)));
    const T g = stress + two_mu_hat_dt * z - safe;
    z = max(z - g / (n * stress / max(z, tiny) + two_mu_hat_dt), tiny);
  }
  return min(eta * exp(n * log(max(z, tiny))), safe);
}

/// What the plastic laws keep of a trial strain: `keep`, the factor of dev ε (`norm` = |dev ε|),
/// and `new_trace`; `stretch` is tr(b)/3. `strain` grows by the equivalent plastic strain.
template <class T>
HWY_INLINE void hencky_return(const Constants<T>& c, T norm, T trace, T stretch, T dt, T& strain,
                              T& keep, T& new_trace) {
  const T zero = scalar<T>(0);
  const T one = scalar<T>(1);
  const T two_mu = T(c.mu + c.mu);
  keep = one;
  new_trace = trace;
  switch (c.law) {
    case Law::kVonMises: {
      const T y =
          fma(two_mu, norm, -(T(c.yield) + scalar<T>(0.816496580927726) * T(c.hardening) * strain));
      const T gamma = max(y, zero) / (two_mu + scalar<T>(2.0 / 3.0) * T(c.hardening));
      keep = one - min(gamma / max(norm, scalar<T>(1e-30)), one);
      strain += scalar<T>(0.816496580927726) * gamma;
      break;
    }
    case Law::kHerschelBulkley: {
      const T s = two_mu * norm;
      const T excess = max(s - T(c.yield), zero);
      const T flow = flow_herschel_bulkley<T>(c, excess, two_mu * stretch * dt);
      const T drop = select(excess > zero, excess - flow, zero);
      keep = one - min(drop / max(s, scalar<T>(1e-30)), one);
      strain += scalar<T>(0.816496580927726) * drop / two_mu;
      break;
    }
    case Law::kDruckerPrager: {
      const T shifted = trace - scalar<T>(3) * T(c.tip);
      const T ratio = T((c.lambda * 3 + c.mu * 2) / (c.mu * 2));
      const T gamma = norm + ratio * (T(c.alpha) * trace - scalar<T>(3) * T(c.alpha_tip));
      const auto beyond_tip = shifted > zero;
      const T slide = one - min(max(gamma, zero) / max(norm, scalar<T>(1e-30)), one);
      keep = select(beyond_tip, zero, slide);
      new_trace = select(beyond_tip, scalar<T>(3) * T(c.tip), trace);
      strain += scalar<T>(0.816496580927726) * (one - keep) * norm;
      break;
    }
    case Law::kFixedCorotated:
    case Law::kNeoHookean:
    case Law::kStvkHencky:
    case Law::kNewtonian:
    case Law::kNeuralIsotropic:
    case Law::kLatent:
    case Law::kPublished:
      break;
  }
}

/// The isotropic neural law. Once a target and type, not once a kernel: it is long, and which law
/// of Hencky strains a body has is the same for all its particles.
template <class T>
HWY_NOINLINE void stress_neural(const Constants<T>& c, const Mat3<T>& h, const T& jm1,
                                const T& mean, const T& dt, Sym3<T>& tau, Sym3<T>& plastic,
                                T& strain) {
  tau = isotropic_stress<T>(c.neural, h, jm1, c.own_volume ? jm1 : mean, dt, plastic, strain);
}

/// The laws on Hencky strains εᵢ = ½ ln(1 + eᵢ), eᵢ the eigenvalues of FᵀF − I: stvk_hencky, the
/// plastic laws on it, and the isotropic neural law. `plastic` gets V diag(σ_new/σ − 1) Vᵀ, so that
/// F_new = F (I + plastic), and `strain` grows by the equivalent plastic strain. Without plastic
/// flow both stay untouched.
template <class T>
HWY_INLINE Sym3<T> stress_hencky(const Constants<T>& c, const Mat3<T>& h, T jm1, T mean, T dt,
                                 Sym3<T>& plastic, T& strain) {
  if (c.law == Law::kNeuralIsotropic) {
    Sym3<T> tau;
    stress_neural<T>(c, h, jm1, mean, dt, tau, plastic, strain);
    return tau;
  }
  T e[3];
  Mat3<T> v;
  eigen_symmetric(right_cauchy_green_minus_identity(h), e, v);
  T eps[3];
  for (int i = 0; i < 3; ++i) {
    e[i] = max(e[i], scalar<T>(-0.999999));  // also rounding beyond −1 of an eigenvalue near 0
    eps[i] = scalar<T>(0.5) * log1p(e[i]);
  }
  const T third = scalar<T>(1.0 / 3.0);
  T trace = eps[0] + eps[1] + eps[2];
  T dev[3];
  for (int i = 0; i < 3; ++i) dev[i] = eps[i] - third * trace;
  const T norm = sqrt(fma(dev[0], dev[0], fma(dev[1], dev[1], dev[2] * dev[2])));
  const T one = scalar<T>(1);
  const T two_mu = T(c.mu + c.mu);
  const T stretch = one + third * (e[0] + e[1] + e[2]);
  T keep;
  T new_trace;
  hencky_return(c, norm, trace, stretch, dt, strain, keep, new_trace);
  T s[3];
  // Volume: U = ½κ ln²J. A return that changes the trace (sand) is a point's own affair.
  const T ln_volume = c.own_volume ? new_trace : log1p(mean) * (jm1 + one) / (mean + one);
  for (int i = 0; i < 3; ++i) {
    s[i] = fma(two_mu * keep, dev[i], T(c.kappa) * ln_volume) / (one + e[i]);
  }
  if (c.plastic) {
    T growth[3];
    const T volume_step = third * (new_trace - trace);
    for (int i = 0; i < 3; ++i) growth[i] = expm1_small(fma(keep - one, dev[i], volume_step));
    plastic = from_eigen(v, growth);
  }
  return push_forward(plus_identity(h), from_eigen(v, s));
}

/// A solid's volume ratio below which crush_pressure acts.
inline constexpr double kCrushRatio = 0.5;

/// Safeguard of solids, zero above J = ½: τ −= (λ+2μ) ((½/J)² − 1) I, continuous, so that no
/// compression turns a cell inside out (a fixed corotated cell has finite energy at J = 0, and a
/// corner that hits the ground gets there). A run that needs it leaves the law's own range.
template <class T>
HWY_INLINE void add_crush_pressure(const Constants<T>& c, T jm1, Sym3<T>& tau) {
  const T j = jm1 + scalar<T>(1);
  const T crushed = max(scalar<T>(kCrushRatio) - j, scalar<T>(0));
  if (none(crushed > scalar<T>(0), crushed)) return;
  const T ratio = scalar<T>(kCrushRatio) / max(j, scalar<T>(1e-6));
  const T pressure = T(c.lambda + c.mu + c.mu) * (ratio * ratio - scalar<T>(1));
  tau = add_diagonal(tau, select(crushed > scalar<T>(0), -pressure, scalar<T>(0)));
}

/// Kelvin–Voigt damping and Newtonian viscosity: τ += J (2 η_s dev D + η_b tr D I), D the symmetric
/// part of the velocity gradient `l`; a fluid's η_d J (∇v + ∇vᵀ) keeps its trace.
template <class T>
HWY_INLINE void add_viscous_stress(const Constants<T>& c, const Mat3<T>& l, T jm1, Sym3<T>& tau) {
  using S = typename LaneTraits<T>::Scalar;
  const T j = jm1 + scalar<T>(1);
  const S fluid = c.fluid ? c.eta : S(0);
  const T shear = T(c.damping_shear + fluid) * j;
  const T trace = l[0][0] + l[1][1] + l[2][2];
  const T spherical = j * trace * T(c.damping_bulk - c.damping_shear * S(2.0 / 3.0));
  tau.xx += fma(shear, l[0][0] + l[0][0], spherical);
  tau.yy += fma(shear, l[1][1] + l[1][1], spherical);
  tau.zz += fma(shear, l[2][2] + l[2][2], spherical);
  tau.yz += shear * (l[1][2] + l[2][1]);
  tau.xz += shear * (l[0][2] + l[2][0]);
  tau.xy += shear * (l[0][1] + l[1][0]);
}

/// Stress and flow of an added family (material::AddedLaw). The file that adds it specialises this
/// with the static functions stress() and adjoint(), of the arguments of kirchhoff_stress() and of
/// kirchhoff_stress_adjoint() without the last.
template <StressFamily kFamily>
struct AddedStress;

/// Kirchhoff stress [Pa] of the trial elastic deformation I + `h`, jm1 = det − 1, `mean` = J̄ − 1
/// (jm1 itself without mean dilatation). See stress_hencky for `plastic` and `strain`.
template <StressFamily kFamily, class T>
HWY_INLINE Sym3<T> kirchhoff_stress(const Constants<T>& c, const Mat3<T>& h, T jm1, T mean, T dt,
                                    Sym3<T>& plastic, T& strain) {
  if constexpr (kFamily == StressFamily::kFixedCorotated) {
    const Mat3<T> f = plus_identity(h);
    return stress_fixed_corotated(c, f, polar_rotation(f), jm1, mean);
  } else if constexpr (kFamily == StressFamily::kNeoHookean) {
    return stress_neo_hookean(c, h, jm1, mean);
  } else if constexpr (kFamily == StressFamily::kNewtonian) {
    return stress_newtonian(c, jm1);
  } else if constexpr (kFamily == StressFamily::kHencky) {
    return stress_hencky(c, h, jm1, mean, dt, plastic, strain);
  } else {
    return AddedStress<kFamily>::template stress<T>(c, h, jm1, mean, dt, plastic, strain);
  }
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
