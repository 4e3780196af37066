// SPDX-License-Identifier: GPL-3.0-or-later
// Relaxation of a register's particles where histories are those before the substep, and stay: the
// adjoints of formulations whose nodes carry the state. Included once per SIMD target.
#if defined(MATTERFIT_MPM_RELAXED_POINT_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_RELAXED_POINT_INL_HPP
#undef MATTERFIT_MPM_RELAXED_POINT_INL_HPP
#else
#define MATTERFIT_MPM_RELAXED_POINT_INL_HPP
#endif

#include "material/classical/maxwell_adjoint-inl.hpp"
#include "mpm/layout.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// add_maxwell_stress() of what `history` holds, which is not touched.
template <class T, class S>
HWY_INLINE void add_maxwell_stress_again(const material::LawConstants<S>& law,
                                         const MaxwellStep<S>* steps, const Mat3<T>& h, T jm1,
                                         const S* history, Sym3<T>& tau) {
  HWY_ALIGN S scratch[12 * material::kMostMaxwellBranches * mpm::kLanes];
  for (std::size_t i = 0; i < 12 * law.maxwell_count; ++i) {
    T::load(history + i * mpm::kLanes).store(scratch + i * mpm::kLanes);
  }
  add_maxwell_stress<T>(law, steps, h, jm1, true, scratch, mpm::kLanes, tau);
}

/// maxwell_stress_adjoint() with the cotangents of the histories in `history_bar`, per branch [6],
/// after the substep and then before it.
template <class T, class S>
HWY_INLINE void maxwell_stress_back(const material::LawConstants<S>& law,
                                    const MaxwellStep<S>* steps, const Mat3<T>& h, T jm1,
                                    const S* history, const Sym3<T>& tau_bar, S* history_bar,
                                    PointBar<T>& bar, MaxwellStepBar<T>* steps_bar) {
  Sym3<T> g_bar[material::kMostMaxwellBranches];
  for (std::size_t i = 0; i < law.maxwell_count; ++i) {
    g_bar[i] = load_sym3<T>(history_bar + i * 6 * mpm::kLanes, mpm::kLanes);
  }
  maxwell_stress_adjoint<T>(law, steps, h, jm1, history, mpm::kLanes, tau_bar, g_bar, bar,
                            steps_bar);
  for (std::size_t i = 0; i < law.maxwell_count; ++i) {
    store_sym3(g_bar[i], history_bar + i * 6 * mpm::kLanes, mpm::kLanes);
  }
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
