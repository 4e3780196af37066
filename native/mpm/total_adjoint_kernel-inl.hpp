// SPDX-License-Identifier: GPL-3.0-or-later
// Adjoint of total_kernel-inl.hpp, a block at a time. Included once per SIMD target.
#if defined(MATTERFIT_MPM_TOTAL_ADJOINT_KERNEL_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_TOTAL_ADJOINT_KERNEL_INL_HPP
#undef MATTERFIT_MPM_TOTAL_ADJOINT_KERNEL_INL_HPP
#else
#define MATTERFIT_MPM_TOTAL_ADJOINT_KERNEL_INL_HPP
#endif

#include <algorithm>
#include <vector>

#include "material/classical/law_step_adjoint-inl.hpp"
#include "mpm/lane_sums-inl.hpp"
#include "mpm/relaxed_point-inl.hpp"
#include "mpm/total_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Everything of one register of particles between the passes: H, J − 1, and their cotangents.
inline constexpr std::size_t kAdjointSlot = 20;

template <StressFamily kFamily, class S>
class TotalForcesAdjoint {
  using D = hn::CappedTag<S, kLanes>;
  using T = Lanes<D>;
  static constexpr std::size_t kWidth = hn::MaxLanes(D());

 public:
  TotalForcesAdjoint(const mpm::TotalAdjointView<S>& view, std::size_t block)
      : view_(view), block_(block), law_(view.forward.law), damped_(law_.damped) {
    maxwell_steps(law_, view.forward.dt, relaxation_);
    const std::uint32_t* nodes = view.forward.block_nodes + block * 8;
    const std::size_t node = reference_node(view.forward, block);
    double reference[3];
    reference_value(view.forward.displacement, node, reference);
    expand_nodes(view.forward.displacement, nodes, reference, displacement_);
    reference_value(view.force_bar, node, reference);
    expand_nodes(view.force_bar, nodes, reference, force_bar_);
    if (damped_) {
      reference_value(view.forward.velocity, node, reference);
      expand_nodes(view.forward.velocity, nodes, reference, velocity_);
    }
  }

  void run(std::vector<S>& slots) {
    const std::uint32_t* chunks = view_.forward.slab_chunks + block_ * kSlabs;
    for (std::size_t slab = 0; slab < kSlabs; ++slab) {
      slots.resize((chunks[slab + 1] - chunks[slab]) * kAdjointSlot * kLanes);
      for (std::size_t lane = 0; lane < kLanes; lane += kWidth) {
        cells(slab, lane, chunks[slab], chunks[slab + 1], slots.data());
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
    mpm::LawCotangents& sums = view_.law_bar[block_];
    sum_law_cotangents(constants_bar_, relaxation_bar_, law_.maxwell_count, sums);
    sums.work = lane_sum(work_);
  }

 private:
  /// The cells of a register: their mean dilatation, then each point's stress, then what comes back
  /// through the mean.
  void cells(std::size_t slab, std::size_t lane, std::uint32_t begin, std::uint32_t end, S* slots) {
    T sum_volume = scalar<T>(0);
    T sum_change = scalar<T>(0);
    for (std::uint32_t chunk = begin; chunk < end; ++chunk) {
      const S* geometry = view_.forward.geometry + chunk * (4 * kLanes) + lane;
      const T volume = T::load(geometry + 3 * kLanes);
      const Mat3<T> h = gradient(displacement_, slab, lane, geometry);
      const T jm1 = determinant_minus_one(h);
      S* slot = slots + (chunk - begin) * (kAdjointSlot * kLanes) + lane;
      store_mat3(h, slot);
      jm1.store(slot + 9 * kLanes);
      sum_volume += volume;
      sum_change = fma(volume, jm1, sum_change);
    }
    const T share = scalar<T>(1) / max(sum_volume, scalar<T>(1e-37));
    const T mean = sum_change * share;
    T mean_bar = scalar<T>(0);
    for (std::uint32_t chunk = begin; chunk < end; ++chunk) {
      mean_bar +=
          point(slab, lane, chunk, mean, slots + (chunk - begin) * (kAdjointSlot * kLanes) + lane);
    }
    for (std::uint32_t chunk = begin; chunk < end; ++chunk) {
      const S* geometry = view_.forward.geometry + chunk * (4 * kLanes) + lane;
      const T volume = T::load(geometry + 3 * kLanes);
      const S* slot = slots + (chunk - begin) * (kAdjointSlot * kLanes) + lane;
      Mat3<T> h_bar = load_mat3<T>(slot + 10 * kLanes);
      const T jm1_bar = fma(volume * share, mean_bar, T::load(slot + 19 * kLanes));
      add_scaled(cofactor(plus_identity(load_mat3<T>(slot))), jm1_bar, h_bar);
      scatter<3, false, T>(out_, slab, lane, load_gradient_stencil<T>(geometry, inverse_dx()),
                           nullptr, h_bar.m);
    }
  }

  /// A register's particles in law_step() and back through it. Histories are those before the
  /// substep, and stay.
  struct Point {
    static constexpr bool kCrushes = true;
    TotalForcesAdjoint& of;
    const S* geometry;
    std::uint32_t chunk;
    std::size_t slab;
    std::size_t lane;
    const Mat3<T>& h;  ///< F − I
    T jm1;
    T mean;
    const Mat3<T>& f;
    const Mat3<T>& cof;
    T inverse_j;
    Mat3<T> rate;  ///< Ḟ and
    Mat3<T> l;     ///< Ḟ F⁻¹, where damped
    Mat3<T> l_bar;
    Mat3<T> cof_bar;

    [[nodiscard]] HWY_INLINE const mpm::TotalView<S>& view() const { return of.view_.forward; }
    [[nodiscard]] HWY_INLINE std::size_t branches() const {
      return view().maxwell != nullptr ? of.law_.maxwell_count : 0;
    }
    [[nodiscard]] HWY_INLINE const S* history() const {
      return view().maxwell + chunk * (12 * of.law_.maxwell_count * kLanes) + lane;
    }
    [[nodiscard]] HWY_INLINE LawTrial<T> trial() const {
      return total_trial<T, S>(view(), chunk, lane, h, jm1, mean);
    }
    template <StressFamily>
    HWY_INLINE void keep(const LawStep<T>& /*taken*/) const {}
    [[nodiscard]] HWY_INLINE bool damped() const { return of.damped_; }
    [[nodiscard]] HWY_INLINE const Mat3<T>& velocity_gradient() const { return l; }
    HWY_INLINE void relax(Sym3<T>& tau) const {
      if (branches() == 0) return;
      add_maxwell_stress_again<T, S>(of.law_, of.relaxation_, h, jm1, history(), tau);
    }

    HWY_INLINE void relax_adjoint(const Sym3<T>& tau_bar, PointBar<T>& bar) {
      if (branches() == 0) return;
      maxwell_stress_back<T, S>(of.law_, of.relaxation_, h, jm1, history(), tau_bar,
                                of.view_.maxwell_bar + chunk * (6 * branches() * kLanes) + lane,
                                bar, of.relaxation_bar_);
    }
    HWY_INLINE Mat3<T>& velocity_gradient_bar() { return l_bar; }
    HWY_INLINE void velocity_gradient_adjoint(PointBar<T>& bar) {
      Mat3<T> rate_bar{};
      add_scaled(multiply(l_bar, cof), inverse_j, rate_bar);
      add_scaled(transpose_multiply(l_bar, rate), inverse_j, cof_bar);
      bar.jm1 -= inverse_j * contract(l_bar, l);
      scatter<3, false, T>(of.out_velocity_, slab, lane,
                           load_gradient_stencil<T>(geometry, of.inverse_dx()), nullptr,
                           rate_bar.m);
    }
    /// History Fᵖ⁻¹ ← Fᵖ⁻¹ (I + flow).
    [[nodiscard]] HWY_INLINE LawKeptBar<T> keep_adjoint(const LawTrial<T>& /*trial*/) const {
      LawKeptBar<T> kept{};
      if (view().plastic == nullptr) return kept;
      const std::size_t at = chunk * (10 * kLanes) + lane;
      const S* of_history = of.view_.plastic_bar + at;
      const Mat3<T> before = plus_identity(load_mat3<T>(view().plastic + at));
      kept.flow = symmetric_part(transpose_multiply(before, load_mat3<T>(of_history)));
      kept.strain = T::load(of_history + 9 * kLanes);
      return kept;
    }
    /// The law is taken of F Fᵖ⁻¹.
    [[nodiscard]] HWY_INLINE bool own_elastic() const { return view().plastic != nullptr; }
    template <StressFamily>
    HWY_INLINE void trial_adjoint(const LawStep<T>& taken, PointBar<T> law, PointBar<T>& bar) {
      if (view().plastic == nullptr) {
        bar = law;
        return;
      }
      const std::size_t at = chunk * (10 * kLanes) + lane;
      S* of_history = of.view_.plastic_bar + at;
      const Mat3<T> before = plus_identity(load_mat3<T>(view().plastic + at));
      if (of.law_.own_volume) {
        add_scaled(cofactor(plus_identity(taken.trial.h)), law.jm1, law.h);
      } else {
        bar.jm1 += law.jm1;
      }
      bar.mean += law.mean;
      add(multiply_transpose(law.h, before), bar.h);
      Mat3<T> before_bar =
          multiply(load_mat3<T>(of_history), add_diagonal(taken.flow, scalar<T>(1)));
      add(transpose_multiply(f, law.h), before_bar);
      store_mat3(before_bar, of_history);
      law.strain.store(of_history + 9 * kLanes);
    }
  };

  /// One particle a lane. Leaves the cotangents of H and J in `slot`; returns that of the mean.
  T point(std::size_t slab, std::size_t lane, std::uint32_t chunk, T mean_of_cell, S* slot) {
    const S* geometry = view_.forward.geometry + chunk * (4 * kLanes) + lane;
    const T volume = T::load(geometry + 3 * kLanes);
    const T dt = T(view_.forward.dt);
    const Mat3<T> h = load_mat3<T>(slot);
    const T jm1 = T::load(slot + 9 * kLanes);
    const T mean = view_.forward.mean_dilatation ? mean_of_cell : jm1;
    const Mat3<T> p_bar = gradient(force_bar_, slab, lane, geometry);
    const Mat3<T> f = plus_identity(h);
    const Mat3<T> cof = cofactor(f);
    const T inverse_j = scalar<T>(1) / (jm1 + scalar<T>(1));

    // Forward again.
    Point at{*this, geometry, chunk, slab, lane, h, jm1, mean, f, cof, inverse_j, {}, {}, {}, {}};
    if (damped_) {
      at.rate = gradient(velocity_, slab, lane, geometry);
      add_scaled(multiply_transpose(at.rate, cof), inverse_j, at.l);
    }
    LawStep<T> taken = law_step<kFamily, T>(law_, dt, at);

    // p = −(V/J) τ cof F.
    const T factor = -volume * inverse_j;
    const Sym3<T> tau_bar = scaled(symmetric_part(multiply_transpose(p_bar, cof)), factor);
    add_scaled(multiply(taken.tau, p_bar), factor, at.cof_bar);
    PointBar<T> bar{};  // of H, J and the mean
    const T work = factor * contract(p_bar, multiply(taken.tau, cof));
    work_ += work;
    bar.jm1 = -inverse_j * work;
    law_step_adjoint<kFamily, false, T>(law_, dt, tau_bar, at, taken, bar, constants_bar_);
    add(tensor_cross(at.cof_bar, f), bar.h);
    store_mat3(bar.h, slot + 10 * kLanes);
    if (view_.forward.mean_dilatation) {
      bar.jm1.store(slot + 19 * kLanes);
      return bar.mean;
    }
    (bar.jm1 + bar.mean).store(slot + 19 * kLanes);
    return scalar<T>(0);
  }

  [[nodiscard]] T inverse_dx() const { return T(S(1) / view_.forward.dx); }

  /// Gradient of a node field at a register's particles, zero where nobody is.
  [[nodiscard]] Mat3<T> gradient(const S* expanded, std::size_t slab, std::size_t lane,
                                 const S* geometry) const {
    Mat3<T> g;
    gather<3, false, T>(expanded, slab, lane, load_gradient_stencil<T>(geometry, inverse_dx()),
                        nullptr, g.m);
    keep_present(T::load(geometry + 3 * kLanes) > scalar<T>(0), g.m);
    return g;
  }

  const mpm::TotalAdjointView<S>& view_;
  std::size_t block_;
  const material::LawConstants<S>& law_;
  bool damped_;
  MaxwellStep<S> relaxation_[material::kMostMaxwellBranches];
  MaxwellStepBar<T> relaxation_bar_[material::kMostMaxwellBranches] = {};
  ConstantsBar<T> constants_bar_{};
  T work_ = scalar<T>(0);
  HWY_ALIGN S displacement_[3 * kExpanded];
  HWY_ALIGN S velocity_[3 * kExpanded];
  HWY_ALIGN S force_bar_[3 * kExpanded];
  HWY_ALIGN S out_[3 * kExpanded] = {};
  HWY_ALIGN S out_velocity_[3 * kExpanded] = {};
};

template <class S>
void total_forces_adjoint(const mpm::TotalAdjointView<S>& view, std::size_t block) {
  static thread_local std::vector<S> slots;
  material::dispatch(material::traits(view.forward.law.law).family,
                     [&]<StressFamily kFamily>()
                         HWY_ATTR { TotalForcesAdjoint<kFamily, S>(view, block).run(slots); });
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
