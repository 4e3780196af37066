// SPDX-License-Identifier: GPL-3.0-or-later
// One substep of a material point: trial state → stress → flow → crush pressure → damping →
// relaxation. The sequence stands here once, for the kernels of every formulation, for their
// adjoints (law_step_adjoint-inl.hpp) and for single points (point_law.hpp).
//
// A formulation differs in where its trial state comes from and where its history lies. It says so
// by a Point, whose functions law_step() calls in this order, each once:
//
//   LawTrial<T> trial() const;                        the trial state, `strain` from the history
//   void keep<kFamily>(const LawStep<T>& taken);      writes the history, which ends with the flow
//   static constexpr bool kCrushes;                   whether add_crush_pressure() acts
//   bool damped() const;                              whether velocity_gradient() is asked for
//   Mat3<T> velocity_gradient() const;                L [1/s]
//   void relax(Sym3<T>& tau) const;                   adds the Maxwell branches, which go on
//
// Included once per SIMD target.
#if defined(MATTERFIT_MATERIAL_LAW_STEP_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_LAW_STEP_INL_HPP
#undef MATTERFIT_MATERIAL_LAW_STEP_INL_HPP
#else
#define MATTERFIT_MATERIAL_LAW_STEP_INL_HPP
#endif

#include "material/classical/maxwell-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// The state at the end of a substep in which nothing flows. An aggregate without initialisers,
/// like all that holds lanes (math/lanes-inl.hpp).
template <class T>
struct LawTrial {
  Mat3<T> h;  ///< elastic deformation gradient − I
  T jm1;      ///< J − 1 that the law's stress goes by
  T mean;     ///< J̄ − 1 (kirchhoff_stress)
  T whole;    ///< J − 1 that crush pressure and viscosity go by
  T strain;   ///< equivalent plastic
};

/// A substep as it was taken.
template <class T>
struct LawStep {
  LawTrial<T> trial;
  Sym3<T> flow;  ///< F = F_trial (I + flow)
  T strain;      ///< equivalent plastic, at its end
  Sym3<T> tau;   ///< Kirchhoff stress [Pa]
};

/// (I + a)(I + b) − I.
template <class T>
HWY_INLINE Mat3<T> compose(const Mat3<T>& a, const Mat3<T>& b) {
  Mat3<T> c = multiply(a, b);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[i][j] += a[i][j] + b[i][j];
  return c;
}

/// (I + h)(I + flow) − I.
template <class T>
HWY_INLINE Mat3<T> flowed(const Mat3<T>& h, const Sym3<T>& flow) {
  Mat3<T> out = multiply(plus_identity(h), flow);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out[i][j] += h[i][j];
  return out;
}

/// What an updated Lagrangian point keeps of F − I: F_trial (I + flow), and of a fluid J^⅓ I.
template <StressFamily kFamily, class T>
HWY_INLINE Mat3<T> elastic_after(const Constants<T>& c, const LawStep<T>& taken) {
  Mat3<T> h = taken.trial.h;
  if constexpr (kFamily == StressFamily::kNewtonian) {
    const T stretch = expm1_small(scalar<T>(1.0 / 3.0) * log1p(taken.trial.jm1));
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) h[i][j] = i == j ? stretch : scalar<T>(0);
  } else if constexpr (material::has_flow(kFamily)) {
    if (c.plastic) h = flowed(h, taken.flow);
  }
  return h;
}

/// Adds to the law's own stress `tau` what acts beside it.
template <class T, class Point>
HWY_INLINE void add_stress_beside(const Constants<T>& c, const LawTrial<T>& trial,
                                  const Point& point, Sym3<T>& tau) {
  if constexpr (Point::kCrushes) add_crush_pressure(c, trial.whole, tau);
  if (point.damped()) add_viscous_stress(c, point.velocity_gradient(), trial.whole, tau);
  point.relax(tau);
}

/// Takes a substep of `dt` [s]; see above for `point`.
template <StressFamily kFamily, class T, class Point>
HWY_INLINE LawStep<T> law_step(const Constants<T>& c, T dt, const Point& point) {
  LawStep<T> taken;
  taken.trial = point.trial();
  taken.flow = {};
  taken.strain = taken.trial.strain;
  taken.tau = kirchhoff_stress<kFamily, T>(c, taken.trial.h, taken.trial.jm1, taken.trial.mean, dt,
                                           taken.flow, taken.strain);
  point.template keep<kFamily>(taken);
  add_stress_beside<T>(c, taken.trial, point, taken.tau);
  return taken;
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
