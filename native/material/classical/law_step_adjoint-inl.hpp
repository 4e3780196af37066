// SPDX-License-Identifier: GPL-3.0-or-later
// Adjoint of law_step-inl.hpp, by hand, in the conventions of laws_adjoint-inl.hpp: relaxation,
// damping, crush pressure, flow, stress and trial state, in this order. Beside the functions that
// law_step() calls a Point has, each called once and in this order:
//
//   void relax_adjoint(const Sym3<T>& tau_bar, PointBar<T>& bar);
//   Mat3<T>& velocity_gradient_bar();               to which the cotangent of L is added; if damped
//   void velocity_gradient_adjoint(PointBar<T>& bar);                                     the same
//   LawKeptBar<T> keep_adjoint(const LawTrial<T>& trial) const;
//   bool own_elastic() const;        the law's deformation is not that of `bar` (see there)
//   void trial_adjoint<kFamily>(const LawStep<T>& taken, const PointBar<T>& law, PointBar<T>& bar);
//
// Included once per SIMD target.
#if defined(MATTERFIT_MATERIAL_LAW_STEP_ADJOINT_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MATERIAL_LAW_STEP_ADJOINT_INL_HPP
#undef MATTERFIT_MATERIAL_LAW_STEP_ADJOINT_INL_HPP
#else
#define MATTERFIT_MATERIAL_LAW_STEP_ADJOINT_INL_HPP
#endif

#include "material/classical/law_step-inl.hpp"
#include "material/classical/maxwell_adjoint-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Cotangents of what a flow leaves in a point's history.
template <class T>
struct LawKeptBar {
  Sym3<T> flow;
  T strain;
};

/// From the cotangent of a substep's stress, and those of its history, to those of what it took.
/// `bar`: of the deformation whose J is LawTrial::whole, of J̄ and of the strain; trial_adjoint()
/// gets that of the law's trial state with it, or apart where own_elastic(). `taken` is the substep
/// as law_step() took it; with kAgain its trial state is, and stress and flow are found on the way,
/// to rounding.
template <StressFamily kFamily, bool kAgain, class T, class Point>
HWY_INLINE void law_step_adjoint(const Constants<T>& c, T dt, const Sym3<T>& tau_bar, Point& point,
                                 LawStep<T>& taken, PointBar<T>& bar, ConstantsBar<T>& c_bar) {
  const LawTrial<T>& trial = taken.trial;
  point.relax_adjoint(tau_bar, bar);
  if (point.damped()) {
    viscous_stress_adjoint(c, point.velocity_gradient(), trial.whole, tau_bar,
                           point.velocity_gradient_bar(), bar, c_bar);
    point.velocity_gradient_adjoint(bar);
  }
  if constexpr (Point::kCrushes) crush_pressure_adjoint(c, trial.whole, tau_bar, bar, c_bar);
  const LawKeptBar<T> kept = point.keep_adjoint(trial);
  PointBar<T> law = bar;
  if (point.own_elastic()) law = {};
  LawAgain<T> again{};
  kirchhoff_stress_adjoint<kFamily, T>(c, trial.h, trial.jm1, trial.mean, dt, trial.strain, tau_bar,
                                       kept.flow, kept.strain, law, c_bar,
                                       kAgain ? &again : nullptr);
  if constexpr (kAgain) {
    taken.tau = again.tau;
    taken.flow = again.plastic;
    add_stress_beside<T>(c, trial, point, taken.tau);
  }
  point.template trial_adjoint<kFamily>(taken, law, bar);
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
