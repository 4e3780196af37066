// SPDX-License-Identifier: GPL-3.0-or-later
// Adjoint of renewed_forces (renewed_kernel-inl.hpp), a block at a time. Included once per SIMD
// target.
#if defined(MATTERFIT_MPM_RENEWED_ADJOINT_KERNEL_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_RENEWED_ADJOINT_KERNEL_INL_HPP
#undef MATTERFIT_MPM_RENEWED_ADJOINT_KERNEL_INL_HPP
#else
#define MATTERFIT_MPM_RENEWED_ADJOINT_KERNEL_INL_HPP
#endif

#include "material/classical/law_step_adjoint-inl.hpp"
#include "mpm/lane_sums-inl.hpp"
#include "mpm/relaxed_point-inl.hpp"
#include "mpm/renewed_adjoint_kernels.hpp"
#include "mpm/renewed_kernel-inl.hpp"
#include "mpm/spline_sums-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// A node field at a register's particles: Σ u_I ⊗ ∇w_I, and its slopes along the place in its
/// cell, by[c][k][j] = ∂(Σ u_I ⊗ ∇w_I)[c][k]/∂f_j.
template <class T>
struct FieldGradient {
  Mat3<T> value;
  T by[3][3][3];
};

template <StressFamily kFamily, class S>
class RenewedForcesAdjoint {
  using D = hn::CappedTag<S, kLanes>;
  using T = Lanes<D>;
  static constexpr std::size_t kWidth = hn::MaxLanes(D());

 public:
  RenewedForcesAdjoint(const mpm::RenewedAdjointView<S>& view, std::size_t block)
      : view_(view),
        block_(block),
        law_(view.forward.law),
        damped_(law_.damped),
        kept_(mpm::renewed_history(law_.law)) {
    maxwell_steps(law_, view.forward.dt, relaxation_);
    double reference[3];
    expand_about(view.forward, block, view.forward.displacement, reference, displacement_);
    expand_about(view.forward, block, view.force_bar, reference, force_bar_);
    if (damped_) expand_about(view.forward, block, view.forward.velocity, reference, velocity_);
  }

  void run() {
    const std::uint32_t* chunks = view_.forward.slab_chunks + block_ * kSlabs;
    for (std::size_t slab = 0; slab < kSlabs; ++slab) {
      for (std::uint32_t chunk = chunks[slab]; chunk < chunks[slab + 1]; ++chunk) {
        for (std::size_t lane = 0; lane < kLanes; lane += kWidth) particles(slab, chunk, lane);
      }
    }
    S* out = view_.displacement_bar + block_ * 3 * kHaloNodes;
    for (std::size_t c = 0; c < 3; ++c) fold(out_ + c * kExpanded, out + c * kHaloNodes);
    if (damped_) {
      S* of_velocity = view_.velocity_bar + block_ * 3 * kHaloNodes;
      for (std::size_t c = 0; c < 3; ++c) {
        fold(out_velocity_ + c * kExpanded, of_velocity + c * kHaloNodes);
      }
    }
    sum_law_cotangents(constants_bar_, relaxation_bar_, law_.maxwell_count, view_.law_bar[block_]);
  }

 private:
  /// A register's particles in law_step_adjoint(). Histories are those before the substep, and
  /// stay.
  struct Point {
    static constexpr bool kCrushes = false;
    RenewedForcesAdjoint& of;
    std::uint32_t chunk;
    std::size_t lane;
    const Mat3<T>& h;  ///< of the motion since the reference, gradient − I
    T jh;              ///< its det − 1
    const Mat3<T>& cof;
    T inverse_j;
    const Mat3<T>& rate;  ///< Ḣ and
    const Mat3<T>& l;     ///< Ḣ (I+H)⁻¹, where damped
    Mat3<T> l_bar;
    Mat3<T> rate_bar;
    Mat3<T> cof_bar;
    PointBar<T> moved_bar;  ///< of h and jh

    [[nodiscard]] HWY_INLINE const mpm::RenewedView<S>& view() const { return of.view_.forward; }
    [[nodiscard]] HWY_INLINE std::size_t branches() const {
      return view().maxwell != nullptr ? of.law_.maxwell_count : 0;
    }
    [[nodiscard]] HWY_INLINE const S* branch() const {
      return view().maxwell + chunk * (12 * of.law_.maxwell_count * kLanes) + lane;
    }
    [[nodiscard]] HWY_INLINE const S* history() const {
      return view().history + chunk * (of.kept_ * kLanes) + lane;
    }
    [[nodiscard]] HWY_INLINE S* history_bar() const {
      return of.view_.history_bar + chunk * (of.kept_ * kLanes) + lane;
    }
    [[nodiscard]] HWY_INLINE bool damped() const { return of.damped_; }
    [[nodiscard]] HWY_INLINE const Mat3<T>& velocity_gradient() const { return l; }
    HWY_INLINE void relax(Sym3<T>& tau) const {
      if (branches() == 0) return;
      add_maxwell_stress_again<T, S>(of.law_, of.relaxation_, h, jh, branch(), tau);
    }

    HWY_INLINE void relax_adjoint(const Sym3<T>& tau_bar, PointBar<T>& /*bar*/) {
      if (branches() == 0) return;
      maxwell_stress_back<T, S>(of.law_, of.relaxation_, h, jh, branch(), tau_bar,
                                of.view_.maxwell_bar + chunk * (6 * branches() * kLanes) + lane,
                                moved_bar, of.relaxation_bar_);
    }
    HWY_INLINE Mat3<T>& velocity_gradient_bar() { return l_bar; }
    HWY_INLINE void velocity_gradient_adjoint(PointBar<T>& /*bar*/) {
      add_scaled(multiply(l_bar, cof), inverse_j, rate_bar);
      add_scaled(transpose_multiply(l_bar, rate), inverse_j, cof_bar);
      moved_bar.jm1 -= inverse_j * contract(l_bar, l);
    }
    /// History I + G ← (I + G)(I + flow).
    [[nodiscard]] HWY_INLINE LawKeptBar<T> keep_adjoint(const LawTrial<T>& /*trial*/) const {
      LawKeptBar<T> kept{};
      if (!of.law_.plastic) return kept;
      const Mat3<T> before = plus_identity(load_mat3<T>(history()));
      kept.flow = symmetric_part(transpose_multiply(before, load_mat3<T>(history_bar())));
      kept.strain = T::load(history_bar() + 9 * kLanes);
      return kept;
    }
    [[nodiscard]] HWY_INLINE bool own_elastic() const { return false; }
    template <StressFamily>
    HWY_INLINE void trial_adjoint(const LawStep<T>& taken, PointBar<T> law, PointBar<T>& /*bar*/) {
      const T one = scalar<T>(1);
      const T jm1_bar = law.jm1 + law.mean;
      if constexpr (kFamily == StressFamily::kNewtonian) {
        moved_bar.jm1 = fma(jm1_bar, T::load(history()) + one, moved_bar.jm1);
        fma(jm1_bar, jh + one, T::load(history_bar())).store(history_bar());
      } else {
        const Mat3<T> before = plus_identity(load_mat3<T>(history()));
        add_scaled(cofactor(plus_identity(taken.trial.h)), jm1_bar, law.h);
        add(multiply_transpose(law.h, before), moved_bar.h);
        Mat3<T> before_bar = load_mat3<T>(history_bar());
        if (of.law_.plastic) {
          before_bar = multiply(before_bar, add_diagonal(taken.flow, one));
          law.strain.store(history_bar() + 9 * kLanes);
        }
        add(transpose_multiply(plus_identity(h), law.h), before_bar);
        store_mat3(before_bar, history_bar());
      }
    }
  };

  void particles(std::size_t slab, std::uint32_t chunk, std::size_t lane) {
    const S* geometry = view_.forward.geometry + chunk * (4 * kLanes) + lane;
    const T volume = T::load(geometry + 3 * kLanes);
    const auto present = volume > scalar<T>(0);
    if (none(present, volume)) return;
    const T one = scalar<T>(1);
    T f[3];
    load_place(geometry, f);
    const CellPlace<T> place = cell_place(f);

    // Forward again.
    const FieldGradient<T> moved = field(displacement_, place, slab, lane, present);
    const FieldGradient<T> pulled = field(force_bar_, place, slab, lane, present);
    const Mat3<T>& h = moved.value;
    const Mat3<T>& p_bar = pulled.value;
    const T jh = determinant_minus_one(h);
    const Mat3<T> cof = cofactor(plus_identity(h));
    const T inverse_j = one / (jh + one);
    FieldGradient<T> rate{};
    Mat3<T> l{};
    if (damped_) {
      rate = field(velocity_, place, slab, lane, present);
      l = present_gradient(rate.value, cof, inverse_j);
    }
    Point at{*this, chunk, lane, h, jh, cof, inverse_j, rate.value, l, {}, {}, {}, {}};
    LawStep<T> taken;
    taken.trial = renewed_trial<kFamily, T, S>(law_, at.history(), h, jh);

    // p = −(V/det) τ cof(I+H), of which the forces are p ∇w.
    const T factor = -volume * inverse_j;
    const Sym3<T> tau_bar = scaled(symmetric_part(multiply_transpose(p_bar, cof)), factor);
    PointBar<T> bar{};
    law_step_adjoint<kFamily, true, T>(law_, T(view_.forward.dt), tau_bar, at, taken, bar,
                                       constants_bar_);
    Mat3<T> p = multiply(taken.tau, cof);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) p[i][j] *= factor;
    add_scaled(multiply(taken.tau, p_bar), factor, at.cof_bar);
    Mat3<T> h_bar = at.moved_bar.h;
    add(tensor_cross(at.cof_bar, plus_identity(h)), h_bar);
    add_scaled(cof, at.moved_bar.jm1 - inverse_j * contract(p_bar, p), h_bar);

    S* place_bar = view_.place_bar + chunk * (3 * kLanes) + lane;
    for (std::size_t j = 0; j < 3; ++j) {
      T sum = T::load(place_bar + j * kLanes);
      for (int c = 0; c < 3; ++c)
        for (int k = 0; k < 3; ++k) {
          sum = fma(p[c][k], pulled.by[c][k][j], sum);
          sum = fma(h_bar[c][k], moved.by[c][k][j], sum);
          if (damped_) sum = fma(at.rate_bar[c][k], rate.by[c][k][j], sum);
        }
      sum.store(place_bar + j * kLanes);
    }
    const Stencil<T> stencil = gradient_stencil(f, inverse_dx());
    scatter<3, false, T>(out_, slab, lane, stencil, nullptr, h_bar.m);
    if (damped_) scatter<3, false, T>(out_velocity_, slab, lane, stencil, nullptr, at.rate_bar.m);
  }

  [[nodiscard]] T inverse_dx() const { return T(S(1) / view_.forward.dx); }

  /// Zero where nobody is.
  template <class Mask>
  [[nodiscard]] FieldGradient<T> field(const S* expanded, const CellPlace<T>& place,
                                       std::size_t slab, std::size_t lane, Mask present) const {
    FieldGradient<T> out;
    const T scale = inverse_dx();
    const auto put = [&](T& to, T value) { to = select(present, scale * value, scalar<T>(0)); };
    for (std::size_t c = 0; c < 3; ++c) {
      const S* component = expanded + c * kExpanded;
      const SplineSums<T> s = spline_sums(place, [&](std::size_t i, std::size_t j, std::size_t k) {
        return T::load(component + mpm::expanded_index(slab + i, j, k) + lane);
      });
      T* value = out.value.m[c];
      put(value[0], s.dww);
      put(value[1], s.wdw);
      put(value[2], s.wwd);
      T(&by)[3][3] = out.by[c];
      put(by[0][0], s.sww);
      put(by[1][1], s.wsw);
      put(by[2][2], s.wws);
      put(by[0][1], s.ddw);
      put(by[0][2], s.dwd);
      put(by[1][2], s.wdd);
      by[1][0] = by[0][1];
      by[2][0] = by[0][2];
      by[2][1] = by[1][2];
    }
    return out;
  }

  const mpm::RenewedAdjointView<S>& view_;
  std::size_t block_;
  const material::LawConstants<S>& law_;
  bool damped_;
  std::size_t kept_;  ///< numbers of history
  MaxwellStep<S> relaxation_[material::kMostMaxwellBranches];
  MaxwellStepBar<T> relaxation_bar_[material::kMostMaxwellBranches] = {};
  ConstantsBar<T> constants_bar_{};
  HWY_ALIGN S displacement_[3 * kExpanded];
  HWY_ALIGN S velocity_[3 * kExpanded];
  HWY_ALIGN S force_bar_[3 * kExpanded];
  HWY_ALIGN S out_[3 * kExpanded] = {};
  HWY_ALIGN S out_velocity_[3 * kExpanded] = {};
};

template <class S>
void renewed_forces_adjoint(const mpm::RenewedAdjointView<S>& view, std::size_t block) {
  material::dispatch(material::traits(view.forward.law.law).family,
                     [&]<StressFamily kFamily>()
                         HWY_ATTR { RenewedForcesAdjoint<kFamily, S>(view, block).run(); });
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
