// SPDX-License-Identifier: GPL-3.0-or-later
// Our neural law (isotropic_weights.hpp) over a scalar or a register of lanes: Kirchhoff stress and
// flow, and their adjoint. As the classical laws on Hencky strains it works in the eigenvectors of
// FᵀF − I: τ = F S Fᵀ, F_new = F (I + plastic). Included once per SIMD target.
#if defined(MATTERFIT_MATERIAL_NEURAL_ISOTROPIC_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_NEURAL_ISOTROPIC_INL_HPP
#undef MATTERFIT_MATERIAL_NEURAL_ISOTROPIC_INL_HPP
#else
#define MATTERFIT_MATERIAL_NEURAL_ISOTROPIC_INL_HPP
#endif

#include "material/neural/isotropic_weights.hpp"
#include "math/mat3_adjoint-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

using material::kShapeUnits;
using material::kVolumeUnits;

template <class T>
using Isotropic = material::IsotropicConstants<typename LaneTraits<T>::Scalar>;

/// tanh, to rounding also near 0.
template <class T>
HWY_INLINE T tanh_small(T x) {
  const T bounded = max(min(x, scalar<T>(15)), scalar<T>(-15));
  const T y = expm1_small(bounded + bounded);
  return y / (y + scalar<T>(2));
}

/// tanh(x)/x.
template <class T>
HWY_INLINE T tanh_over(T x) {
  const auto small = abs(x) < scalar<T>(0.01);
  const T s = x * x;
  const T series =
      fma(s, fma(s, fma(s, scalar<T>(-17.0 / 315), scalar<T>(2.0 / 15)), scalar<T>(-1.0 / 3)),
          scalar<T>(1));
  return select(small, series, tanh_small(x) / select(small, scalar<T>(1), x));
}

/// A unit's tanh(z + c) − tanh(c) by the addition theorem: no cancellation near rest; `offset` =
/// tanh(c).
template <class T>
HWY_INLINE T unit_rise(T z, T offset) {
  const T t = tanh_small(z);
  return t * fnma(offset, offset, scalar<T>(1)) / fma(t, offset, scalar<T>(1));
}

/// What the flow makes of a trial strain.
template <class T>
struct IsotropicFlowState {
  T argument;     ///< of s, for Y
  T root;         ///< √(argument² + w²)
  T yield;        ///< Y
  T over;         ///< q − Y
  T relaxed;      ///< 1/(1 + ρ dt)
  T keep_shape;   ///< factor of dev ε by yielding
  T keep_volume;  ///< factor of ε by the limit in tension
  T keep;         ///< their product
};

template <class T>
HWY_INLINE IsotropicFlowState<T> isotropic_flow(const Isotropic<T>& c, T norm, T theta, T strain,
                                                T dt) {
  const T one = scalar<T>(1);
  const T zero = scalar<T>(0);
  IsotropicFlowState<T> s;
  s.argument = fma(T(c.hardening), strain, T(c.yield)) - T(c.friction) * theta;
  s.root =
      sqrt(fma(s.argument, s.argument, scalar<T>(material::kYieldWidth * material::kYieldWidth)));
  s.yield = scalar<T>(0.5) * (s.argument + s.root);
  s.over = norm - s.yield;
  s.relaxed = one / fma(fma(T(c.thinning), max(s.over, zero), T(c.rate)), dt, one);
  s.keep_shape =
      select(s.over > zero, fma(s.over, s.relaxed, s.yield) / max(norm, scalar<T>(1e-15)), one);
  s.keep_volume = select(theta > T(c.tension), T(c.tension) / max(theta, scalar<T>(1e-15)), one);
  s.keep = s.keep_shape * s.keep_volume;
  return s;
}

/// Strains of F = I + h in their frame.
template <class T>
struct HenckyFrame {
  Mat3<T> v;
  T e[3];        ///< eigenvalues of FᵀF − I
  T inverse[3];  ///< 1/(1 + e)
  T dev[3];      ///< dev ε
  T norm;        ///< |dev ε|
};

template <class T>
HWY_INLINE HenckyFrame<T> hencky_frame(const Mat3<T>& h) {
  HenckyFrame<T> s;
  eigen_symmetric(right_cauchy_green_minus_identity(h), s.e, s.v);
  T sum = scalar<T>(0);
  for (int i = 0; i < 3; ++i) {
    s.e[i] = max(s.e[i], scalar<T>(-0.999999));
    s.inverse[i] = scalar<T>(1) / (scalar<T>(1) + s.e[i]);
    s.dev[i] = scalar<T>(0.5) * log1p(s.e[i]);
    sum += s.dev[i];
  }
  for (int i = 0; i < 3; ++i) s.dev[i] = fma(scalar<T>(-1.0 / 3), sum, s.dev[i]);
  s.norm = sqrt(fma(s.dev[0], s.dev[0], fma(s.dev[1], s.dev[1], s.dev[2] * s.dev[2])));
  return s;
}

/// What the units give: kept for the adjoint.
template <class T>
struct UnitRises {
  T shape[kShapeUnits][3];
  T volume[kVolumeUnits];
};

/// The stress of κ and the volume units, the same in all directions.
template <class T>
HWY_INLINE T volume_stress(const Isotropic<T>& c, T theta, UnitRises<T>& rise) {
  T pressure = T(c.kappa) * theta;
  for (std::size_t k = 0; k < kVolumeUnits; ++k) {
    rise.volume[k] = unit_rise(T(c.volume_trace[k]) * theta, T(c.volume_offset[k]));
    pressure = fma(T(c.volume_gain[k] * c.volume_trace[k]), rise.volume[k], pressure);
  }
  return pressure;
}

/// Principal stresses of strains dev ε + θ/3 by μ and the shape units.
template <class T>
HWY_INLINE void shape_stresses(const Isotropic<T>& c, const T dev[3], T theta, T tau[3],
                               UnitRises<T>& rise) {
  T pressure = scalar<T>(0);
  T own[3];
  const T two_mu = T(c.mu + c.mu);
  for (int i = 0; i < 3; ++i) own[i] = two_mu * dev[i];
  const T third = scalar<T>(1.0 / 3);
  for (std::size_t k = 0; k < kShapeUnits; ++k) {
    const T common = fma(third, T(c.shape_own[k]), T(c.shape_trace[k])) * theta;
    T sum = scalar<T>(0);
    for (int i = 0; i < 3; ++i) {
      rise.shape[k][i] = unit_rise(fma(T(c.shape_own[k]), dev[i], common), T(c.shape_offset[k]));
      own[i] = fma(T(c.shape_gain[k] * c.shape_own[k]), rise.shape[k][i], own[i]);
      sum += rise.shape[k][i];
    }
    pressure = fma(T(c.shape_gain[k] * c.shape_trace[k]), sum, pressure);
  }
  for (int i = 0; i < 3; ++i) tau[i] = own[i] + pressure;
}

/// Kirchhoff stress [Pa] after the flow of the trial deformation I + `h`, jm1 = det − 1; `mean` =
/// J̄ − 1 of the cell where the dilatation is averaged, jm1 itself elsewhere: κ and the volume units
/// see J̄, as a classical law's volume term does, so that forces stay the derivative of an energy.
/// `plastic` gets V diag(σ_new/σ − 1) Vᵀ, `strain` grows by the equivalent plastic strain.
template <class T>
HWY_INLINE Sym3<T> isotropic_stress(const Isotropic<T>& c, const Mat3<T>& h, T jm1, T mean, T dt,
                                    Sym3<T>& plastic, T& strain) {
  const T one = scalar<T>(1);
  const T third = scalar<T>(1.0 / 3);
  const HenckyFrame<T> at = hencky_frame(h);
  const T theta = log1p(jm1);
  const IsotropicFlowState<T> flow = isotropic_flow<T>(c, at.norm, theta, strain, dt);
  T dev[3];
  T growth[3];
  const T volume_step = third * (flow.keep_volume - one) * theta;
  for (int i = 0; i < 3; ++i) {
    dev[i] = flow.keep * at.dev[i];
    growth[i] = expm1_small(fma(flow.keep - one, at.dev[i], volume_step));
  }
  plastic = from_eigen(at.v, growth);
  strain += scalar<T>(0.816496580927726) * (one - flow.keep) * at.norm;
  T tau[3];
  UnitRises<T> rise;
  shape_stresses<T>(c, dev, flow.keep_volume * theta, tau, rise);
  const T volume =
      volume_stress<T>(c, flow.keep_volume * log1p(mean), rise) * ((one + jm1) / (one + mean));
  for (int i = 0; i < 3; ++i) tau[i] = (tau[i] + volume) * at.inverse[i];
  return push_forward(plus_identity(h), from_eigen(at.v, tau));
}

/// Cotangents of what isotropic_stress takes; sums.
template <class T>
struct IsotropicBar {
  Mat3<T> h;
  T jm1;
  T mean;
  T strain;
};

/// The derivative of a unit's rise: by z, and by tanh(c).
template <class T>
HWY_INLINE T rise_slope(T rise, T offset) {
  const T level = rise + offset;
  return fnma(level, level, scalar<T>(1));
}
template <class T>
HWY_INLINE T rise_by_offset(T rise, T offset) {
  return -rise * (rise + offset + offset) / fnma(offset, offset, scalar<T>(1));
}

/// Adjoint of volume_stress: the cotangent of θ; adds to those of the constants.
template <class T>
HWY_INLINE T volume_stress_adjoint(const Isotropic<T>& c, T theta, const UnitRises<T>& rise,
                                   T pressure_bar, material::IsotropicConstants<T>& c_bar) {
  c_bar.kappa = fma(theta, pressure_bar, c_bar.kappa);
  T theta_bar = T(c.kappa) * pressure_bar;
  for (std::size_t k = 0; k < kVolumeUnits; ++k) {
    const T gain(c.volume_gain[k]);
    const T trace(c.volume_trace[k]);
    const T offset(c.volume_offset[k]);
    const T r = rise.volume[k];
    const T r_bar = gain * trace * pressure_bar;
    const T z_bar = r_bar * rise_slope(r, offset);
    theta_bar = fma(z_bar, trace, theta_bar);
    c_bar.volume_gain[k] += trace * r * pressure_bar;
    c_bar.volume_trace[k] += fma(gain * r, pressure_bar, z_bar * theta);
    c_bar.volume_offset[k] += r_bar * rise_by_offset(r, offset);
  }
  return theta_bar;
}

/// Adjoint of shape_stresses: adds to the cotangents of dev, theta and the constants.
template <class T>
HWY_INLINE void shape_stresses_adjoint(const Isotropic<T>& c, const T dev[3], T theta,
                                       const UnitRises<T>& rise, const T tau_bar[3], T dev_bar[3],
                                       T& theta_bar, material::IsotropicConstants<T>& c_bar) {
  const T third = scalar<T>(1.0 / 3);
  const T all = tau_bar[0] + tau_bar[1] + tau_bar[2];
  T of_mu = scalar<T>(0);
  for (int i = 0; i < 3; ++i) {
    of_mu = fma(dev[i], tau_bar[i], of_mu);
    dev_bar[i] = fma(T(c.mu + c.mu), tau_bar[i], dev_bar[i]);
  }
  c_bar.mu += of_mu + of_mu;
  for (std::size_t k = 0; k < kShapeUnits; ++k) {
    const T gain(c.shape_gain[k]);
    const T own(c.shape_own[k]);
    const T trace(c.shape_trace[k]);
    const T offset(c.shape_offset[k]);
    T sum = scalar<T>(0);
    T weighted = scalar<T>(0);
    T z_sum = scalar<T>(0);
    T of_own = scalar<T>(0);
    T of_offset = scalar<T>(0);
    for (int i = 0; i < 3; ++i) {
      const T r = rise.shape[k][i];
      sum += r;
      weighted = fma(r, tau_bar[i], weighted);
      const T r_bar = gain * fma(own, tau_bar[i], trace * all);
      const T z_bar = r_bar * rise_slope(r, offset);
      dev_bar[i] = fma(own, z_bar, dev_bar[i]);
      z_sum += z_bar;
      of_own = fma(z_bar, fma(third, theta, dev[i]), of_own);
      of_offset = fma(r_bar, rise_by_offset(r, offset), of_offset);
    }
    theta_bar = fma(z_sum, fma(third, own, trace), theta_bar);
    c_bar.shape_gain[k] += fma(own, weighted, trace * sum * all);
    c_bar.shape_own[k] += fma(gain, weighted, of_own);
    c_bar.shape_trace[k] += fma(gain * sum, all, z_sum * theta);
    c_bar.shape_offset[k] += of_offset;
  }
}

/// Adjoint of isotropic_flow, from the cotangents of keep and keep_volume.
template <class T>
HWY_INLINE void isotropic_flow_adjoint(const Isotropic<T>& c, const IsotropicFlowState<T>& s,
                                       T norm, T theta, T strain, T dt, T keep_bar,
                                       T keep_volume_bar, T& norm_bar, T& theta_bar, T& strain_bar,
                                       material::IsotropicConstants<T>& c_bar) {
  const T one = scalar<T>(1);
  const T zero = scalar<T>(0);
  const auto flows = s.over > zero;
  const auto torn = theta > T(c.tension);
  const T volume_bar = fma(keep_bar, s.keep_shape, keep_volume_bar);
  const T inverse_theta = one / max(theta, scalar<T>(1e-15));
  c_bar.tension += select(torn, volume_bar * inverse_theta, zero);
  theta_bar -= select(torn, volume_bar * s.keep_volume * inverse_theta, zero);
  // keep_shape = (Y + over · relaxed)/norm
  const T inverse_norm = one / max(norm, scalar<T>(1e-15));
  const T total_bar = select(flows, keep_bar * s.keep_volume * inverse_norm, zero);
  norm_bar -= total_bar * s.keep_shape;
  const T relaxed_bar = total_bar * s.over;
  // relaxed = 1/(1 + ρ dt)
  const T rho_bar = -relaxed_bar * s.relaxed * s.relaxed * dt;
  c_bar.rate += rho_bar;
  c_bar.thinning += rho_bar * s.over;
  const T over_bar = fma(total_bar, s.relaxed, rho_bar * T(c.thinning));
  norm_bar += over_bar;
  const T argument_bar = scalar<T>(0.5) * (total_bar - over_bar) * (one + s.argument / s.root);
  c_bar.yield += argument_bar;
  c_bar.hardening += argument_bar * strain;
  strain_bar += argument_bar * T(c.hardening);
  c_bar.friction -= argument_bar * theta;
  theta_bar -= argument_bar * T(c.friction);
}

/// Adds to `bar` and `c_bar` from the cotangents of τ, of `plastic` and of the plastic strain
/// after; `strain` is the one before. Where the flow has a kink the side of the forward pass
/// counts. Sets `tau_again` and `plastic_again`, if not null, to what isotropic_stress gives.
template <class T>
HWY_INLINE void isotropic_stress_adjoint(const Isotropic<T>& c, const Mat3<T>& h, T jm1, T mean,
                                         T dt, T strain, const Sym3<T>& tau_bar,
                                         const Sym3<T>& plastic_bar, T strain_bar,
                                         IsotropicBar<T>& bar,
                                         material::IsotropicConstants<T>& c_bar,
                                         Sym3<T>* tau_again = nullptr,
                                         Sym3<T>* plastic_again = nullptr) {
  const T one = scalar<T>(1);
  const T zero = scalar<T>(0);
  const T third = scalar<T>(1.0 / 3);
  const HenckyFrame<T> at = hencky_frame(h);
  const T theta = log1p(jm1);
  const T mean_theta = log1p(mean);
  const IsotropicFlowState<T> flow = isotropic_flow<T>(c, at.norm, theta, strain, dt);
  const T less = flow.keep - one;
  const T volume_step = third * (flow.keep_volume - one) * theta;
  T dev[3];
  T growth[3];
  for (int i = 0; i < 3; ++i) {
    dev[i] = flow.keep * at.dev[i];
    growth[i] = expm1_small(fma(less, at.dev[i], volume_step));
  }
  const T new_theta = flow.keep_volume * theta;
  T tau[3];
  UnitRises<T> rise;
  shape_stresses<T>(c, dev, new_theta, tau, rise);
  const T new_mean_theta = flow.keep_volume * mean_theta;
  const T pressure = volume_stress<T>(c, new_mean_theta, rise);
  const T inverse_mean = one / (one + mean);
  const T ratio = (one + jm1) * inverse_mean;
  T phi[3];
  for (int i = 0; i < 3; ++i) phi[i] = fma(pressure, ratio, tau[i]) * at.inverse[i];

  // τ = F S Fᵀ
  const Mat3<T> f = plus_identity(h);
  const Mat3<T> tf = multiply(tau_bar, f);
  const Sym3<T> pulled_back = from_eigen(at.v, phi);
  if (tau_again != nullptr) *tau_again = push_forward(f, pulled_back);
  if (plastic_again != nullptr) *plastic_again = from_eigen(at.v, growth);
  add_twice(multiply(tf, pulled_back), bar.h);
  const Mat3<T> s_bar = rotate_back(at.v, transpose_multiply(f, tf));
  const Mat3<T> g_bar = rotate_back(at.v, to_matrix(plastic_bar));

  // Off the diagonal.
  Mat3<T> e_bar;
  for (int i = 0; i < 3; ++i)
    for (int j = i + 1; j < 3; ++j) {
      // (εᵢ − εⱼ)/(eᵢ − eⱼ)
      const T quotient =
          scalar<T>(0.5) * log1p_over((at.e[i] - at.e[j]) * at.inverse[j]) * at.inverse[j];
      const T gap = at.dev[i] - at.dev[j];
      // (τᵢ − τⱼ)/(εᵢ − εⱼ) of the strains after the flow
      T stiffness = T(c.mu + c.mu);
      for (std::size_t k = 0; k < kShapeUnits; ++k) {
        const T own(c.shape_own[k]);
        const T offset(c.shape_offset[k]);
        const T product = (rise.shape[k][i] + offset) * (rise.shape[k][j] + offset);
        stiffness = fma(T(c.shape_gain[k]) * own * own * tanh_over(own * flow.keep * gap),
                        one - product, stiffness);
      }
      const T stress = (stiffness * flow.keep * quotient - phi[j]) * at.inverse[i];
      const T step = (one + growth[j]) * expm1_over(less * gap) * less * quotient;
      e_bar[i][j] = e_bar[j][i] = fma(stress, s_bar[i][j], step * g_bar[i][j]);
    }

  // On it.
  T stress_bar[3];
  T all = zero;
  for (int i = 0; i < 3; ++i) {
    stress_bar[i] = s_bar[i][i] * at.inverse[i];
    all += stress_bar[i];
    e_bar[i][i] = -phi[i] * stress_bar[i];
  }
  const T ratio_bar = pressure * all;
  bar.jm1 = fma(ratio_bar, inverse_mean, bar.jm1);
  bar.mean -= ratio_bar * ratio * inverse_mean;
  T new_dev_bar[3] = {zero, zero, zero};
  T new_theta_bar = zero;
  shape_stresses_adjoint<T>(c, dev, new_theta, rise, stress_bar, new_dev_bar, new_theta_bar, c_bar);
  const T new_mean_bar = volume_stress_adjoint<T>(c, new_mean_theta, rise, ratio * all, c_bar);
  T keep_bar = zero;
  T keep_volume_bar = fma(new_theta_bar, theta, new_mean_bar * mean_theta);
  T theta_bar = new_theta_bar * flow.keep_volume;
  bar.mean = fma(new_mean_bar * flow.keep_volume, inverse_mean, bar.mean);
  T dev_bar[3];
  for (int i = 0; i < 3; ++i) {
    const T step_bar = g_bar[i][i] * (one + growth[i]);
    keep_bar = fma(new_dev_bar[i] + step_bar, at.dev[i], keep_bar);
    dev_bar[i] = fma(flow.keep, new_dev_bar[i], less * step_bar);
    keep_volume_bar = fma(third * theta, step_bar, keep_volume_bar);
    theta_bar = fma(third * (flow.keep_volume - one), step_bar, theta_bar);
  }
  const T grown_bar = scalar<T>(0.816496580927726) * strain_bar;
  keep_bar -= grown_bar * at.norm;
  T norm_bar = -grown_bar * less;
  bar.strain += strain_bar;
  isotropic_flow_adjoint<T>(c, flow, at.norm, theta, strain, dt, keep_bar, keep_volume_bar,
                            norm_bar, theta_bar, bar.strain, c_bar);
  bar.jm1 += theta_bar / (one + jm1);
  const T along = norm_bar / max(at.norm, scalar<T>(1e-15));
  T sum = zero;
  for (int i = 0; i < 3; ++i) {
    dev_bar[i] = fma(along, at.dev[i], dev_bar[i]);
    sum += dev_bar[i];
  }
  for (int i = 0; i < 3; ++i) {
    e_bar[i][i] += scalar<T>(0.5) * at.inverse[i] * fma(-third, sum, dev_bar[i]);
  }
  add_twice(multiply(f, rotate_forth(at.v, e_bar)), bar.h);
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
