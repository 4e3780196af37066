// SPDX-License-Identifier: GPL-3.0-or-later
// Adjoint of updated_kernel-inl.hpp, a block at a time. Included once per SIMD target.
#if defined(MATTERFIT_MPM_UPDATED_ADJOINT_KERNEL_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_UPDATED_ADJOINT_KERNEL_INL_HPP
#undef MATTERFIT_MPM_UPDATED_ADJOINT_KERNEL_INL_HPP
#else
#define MATTERFIT_MPM_UPDATED_ADJOINT_KERNEL_INL_HPP
#endif

#include <hwy/cache_control.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <type_traits>

#include "material/classical/law_step_adjoint-inl.hpp"
#include "math/transpose-inl.hpp"
#include "mpm/lane_sums-inl.hpp"
#include "mpm/spline_sums-inl.hpp"
#include "mpm/total_kernel-inl.hpp"
#include "mpm/updated_adjoint_kernels.hpp"
#include "mpm/updated_published_back-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <StressFamily kFamily, class S>
class UpdatedBlockAdjoint {
  using D = hn::CappedTag<S, kLanes>;
  using T = Lanes<D>;
  using Chunk = mpm::UpdatedChunk<S>;
  static constexpr std::size_t kWidth = hn::MaxLanes(D());
  static constexpr std::size_t kBars = 16;  ///< numbers of an UpdatedParticleBar
  static constexpr bool kPublished = kFamily == StressFamily::kPublished;

 public:
  explicit UpdatedBlockAdjoint(mpm::UpdatedAdjointView<S>& view) : view_(view), law_(view.law) {
    if constexpr (kPublished) published_.begin(view.published, view.dt);
    maxwell_steps(law_, view.dt, relaxation_);
    expand_blocks(view.node_velocity, 3, velocity_);
    const S* bars[8];
    for (std::size_t k = 0; k < 8; ++k) {
      bars[k] = view.node_bar[13 + 9 * (k / 4) + 3 * (k / 2 % 2) + k % 2];
    }
    expand_blocks(bars, 4, node_bar_);
  }

  void run() {
    for (std::size_t slab = 0; slab < kSlabs; ++slab) {
      for (std::uint32_t k = 0; k < view_.chunks[slab]; ++k) {
        if (k + 1 < view_.chunks[slab]) fetch_bars(view_.slab[slab][k + 1]);
        for (std::size_t lane = 0; lane < kLanes; lane += kWidth) {
          particles(slab, view_.slab[slab][k], lane);
          if constexpr (kPublished) {
            if (published_.full()) through_nets();
          }
        }
      }
    }
    if constexpr (kPublished) through_nets();
    HWY_ALIGN S folded[kHaloNodes];
    for (std::size_t c = 0; c < 3; ++c) {
      fold(out_ + c * kExpanded, folded);
      S* halo = view_.velocity_bar + c * kHaloNodes;
      for (std::size_t i = 0; i < kHaloNodes; ++i) halo[i] += folded[i];
    }
    sum_law_cotangents(constants_bar_, relaxation_bar_, law_.maxwell_count, view_.law_bar);
    view_.log_density = lane_sum(log_density_);
  }

 private:
  /// A register's particles in law_step_adjoint(), their history before the substep.
  struct Point {
    static constexpr bool kCrushes = false;
    UpdatedBlockAdjoint& of;
    const mpm::KeptChunk<S>& chunk;
    std::size_t lane;
    const S* bars;
    const Mat3<T>& affine;  ///< C [1/s]
    Mat3<T>& affine_bar;
    const Mat3<T>& step;  ///< dt C
    Mat3<T> step_bar;

    [[nodiscard]] HWY_INLINE std::size_t branches() const {
      return of.view_.maxwell != nullptr ? of.law_.maxwell_count : 0;
    }
    [[nodiscard]] HWY_INLINE bool damped() const { return of.law_.damped; }
    [[nodiscard]] HWY_INLINE const Mat3<T>& velocity_gradient() const { return affine; }
    HWY_INLINE void relax(Sym3<T>& tau) const {
      for (std::size_t i = 0; i < branches(); ++i) {
        const Sym3<T> held = of.load_branch(of.view_.maxwell, chunk, lane, i);
        (void)carry_maxwell<T>(of.relaxation_[i], step, held, tau);
      }
    }

    HWY_INLINE void relax_adjoint(const Sym3<T>& tau_bar, PointBar<T>& /*bar*/) {
      for (std::size_t i = 0; i < branches(); ++i) {
        const Sym3<T> held = of.load_branch(of.view_.maxwell, chunk, lane, i);
        const Sym3<T> next_bar = of.load_branch(of.view_.maxwell_bar, chunk, lane, i);
        of.store_branch(carry_maxwell_adjoint(of.relaxation_[i], step, held, tau_bar, next_bar,
                                              step_bar, of.relaxation_bar_[i]),
                        chunk, lane, i);
      }
    }
    HWY_INLINE Mat3<T>& velocity_gradient_bar() { return affine_bar; }
    HWY_INLINE void velocity_gradient_adjoint(PointBar<T>& /*bar*/) {}
    [[nodiscard]] HWY_INLINE Mat3<T> after_bar() const {
      Mat3<T> after;
      for (int i = 0; i < 9; ++i) {
        after[i / 3][i % 3] = bar(bars, kH + static_cast<std::size_t>(i));
      }
      return after;
    }
    [[nodiscard]] HWY_INLINE LawKeptBar<T> keep_adjoint(const LawTrial<T>& trial) const {
      LawKeptBar<T> kept{};
      if (!of.law_.plastic) return kept;
      kept.flow = symmetric_part(transpose_multiply(plus_identity(trial.h), after_bar()));
      kept.strain = bar(bars, kStrain);
      return kept;
    }
    [[nodiscard]] HWY_INLINE bool own_elastic() const { return false; }
    /// The adjoint of elastic_after(), and of J as that of I + h.
    template <StressFamily>
    HWY_INLINE void trial_adjoint(const LawStep<T>& taken, const PointBar<T>& law,
                                  PointBar<T>& all) {
      const T one = scalar<T>(1);
      all = law;
      Mat3<T> after = after_bar();
      if constexpr (kFamily == StressFamily::kNewtonian) {
        // F = J^⅓ I.
        const T third = scalar<T>(1.0 / 3.0);
        const T jm1 = taken.trial.jm1;
        const T trace = after[0][0] + after[1][1] + after[2][2];
        all.jm1 += trace * third * exp(third * log1p(jm1)) / (jm1 + one);
      } else {
        if (of.law_.plastic) after = multiply(after, add_diagonal(taken.flow, one));
        add(after, all.h);
      }
      if (!of.law_.plastic) all.strain += bar(bars, kStrain);
      add_scaled(cofactor(plus_identity(taken.trial.h)), all.jm1 + all.mean, all.h);
    }
  };

  /// The registers that wait for the nets: through them, and the rest of their way.
  void through_nets() {
    published_.run(view_.published_bar);
    for (const auto& register_of : published_) {
      particles(register_of.slab, *register_of.chunk, register_of.lane);
    }
    published_.clear();
  }

  /// Momentum and mass on the next grid, as seen from the particles' new places.
  struct Landing {
    SplineSums<T> momentum[3];
    T mass, mass_by[3];
  };

  void particles(std::size_t slab, const mpm::KeptChunk<S>& chunk, std::size_t lane) {
    const T zero = scalar<T>(0);
    const T one = scalar<T>(1);
    const T dt = T(view_.dt);
    const T volume = T::load(&chunk.a[Chunk::kVolume][lane]);
    const auto present = volume > zero;
    if (none(present, volume)) return;
    HWY_ALIGN S bars[kBars * kLanes];
    load_bars(chunk, lane, bars);

    // Forward again, with the derivatives by place.
    T f[3];
    for (std::size_t c = 0; c < 3; ++c) f[c] = T::load(&chunk.a[Chunk::kF + c][lane]);
    const CellPlace<T> place = cell_place(f);
    Transferred<T> moved[3];  // of the node velocities
    T velocity[3];
    Mat3<T> affine;
    const T four_over_dx = T(S(4) / view_.dx);
    for (int c = 0; c < 3; ++c) {
      const SplineSums<T> sums = spline_sums(
          place, expanded(velocity_ + static_cast<std::size_t>(c) * kExpanded, slab, lane));
      moved[c] = transferred(place, sums);
      affine_sums(place, sums, affine[c]);
      velocity[c] = select(present, moved[c].value, zero);
      for (int k = 0; k < 3; ++k) {
        affine[c][k] = select(present, four_over_dx * affine[c][k], zero);
      }
    }
    T landed[3];
    const T dt_over_dx = T(view_.dt / view_.dx);
    for (int c = 0; c < 3; ++c)
      landed[c] = select(present, fma(dt_over_dx, velocity[c], f[c]), one);
    const Mat3<T> before = load_mat3<T>(&chunk.a[Chunk::kH][lane]);
    Mat3<T> step;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) step[i][j] = dt * affine[i][j];
    const Mat3<T> trial = compose(step, before);
    const T jm1 = determinant_minus_one(trial);

    // Particles to grid: momentum Σ w m v + A (x_I − x)/dx, A = dx m C − dt V (4/dx) τ, and mass.
    CellPlace<T> new_place;
    const Landing landing = land(slab, lane, chunk, present, landed, new_place);
    const T mass = T(view_.density) * volume;
    const T mass_dx = T(view_.density * view_.dx) * volume;
    const T stress_factor = T(view_.dt * S(4) / view_.dx) * volume;
    Mat3<T> a_bar;
    for (int c = 0; c < 3; ++c) affine_sums(new_place, landing.momentum[c], a_bar[c]);
    Mat3<T> affine_bar;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) affine_bar[i][j] = mass_dx * a_bar[i][j];

    // Stress and flow, and τ again.
    Point point{*this, chunk, lane, bars, affine, affine_bar, step, {}};
    LawStep<T> taken;
    taken.trial = {trial, jm1, jm1, jm1, T::load(&chunk.a[Chunk::kStrain][lane])};
    PointBar<T> law_bar{};
    Mat3<T> stress;
    if constexpr (kPublished) {
      if (!published_.through) {  // the nets are yet to be gone through
        published_.put({slab, &chunk, lane}, trial, point.after_bar(), a_bar, stress_factor);
        return;
      }
      published_.law_adjoint(law_, point, taken.trial, stress, law_bar, constants_bar_);
      law_bar.strain = bar(bars, kStrain);
    } else {
      const Sym3<T> tau_bar = scaled(symmetric_part(a_bar), -stress_factor);
      law_step_adjoint<kFamily, true, T>(law_, dt, tau_bar, point, taken, law_bar, constants_bar_);
      stress = to_matrix(taken.tau);
    }
    Mat3<T>& step_bar = point.step_bar;

    // What the new place changes of the transfer.
    T velocity_bar[3];
    T place_bar[3];  // of f, in cells
    T weight = landing.mass;
    for (std::size_t c = 0; c < 3; ++c) {
      place_bar[c] = fma(T(view_.dx), bar(bars, kPosition + c), mass * landing.mass_by[c]);
    }
    for (int c = 0; c < 3; ++c) {
      const Transferred<T> n = transferred(new_place, landing.momentum[c]);
      velocity_bar[c] = fma(mass, n.value, bar(bars, kVelocity + static_cast<std::size_t>(c)));
      weight = fma(velocity[c], n.value, weight);
      const T value = mass * velocity[c];
      for (int j = 0; j < 3; ++j) place_bar[j] = fma(value, n.value_by[j], place_bar[j]);
      for (int k = 0; k < 3; ++k) {
        const T a = fnma(stress_factor, stress[c][k], mass_dx * affine[c][k]);
        for (int j = 0; j < 3; ++j) place_bar[j] = fma(a, n.affine_by[k][j], place_bar[j]);
        weight = fma(T(view_.dx) * affine[c][k], a_bar[c][k], weight);
      }
    }
    log_density_ = fma(mass, weight, log_density_);

    // F_trial = (I + dt C) F.
    const Mat3<T> before_bar = transpose_multiply(plus_identity(step), law_bar.h);
    add(multiply_transpose(law_bar.h, plus_identity(before)), step_bar);
    add_scaled(step_bar, dt, affine_bar);

    // Grid to particles: f += dt v/dx, v = Σ w v_I, C = (4/dx) Σ w (x_I − x)/dx v_I.
    T matrix_bar[3][3];
    for (int c = 0; c < 3; ++c) {
      velocity_bar[c] = select(present, fma(dt_over_dx, place_bar[c], velocity_bar[c]), zero);
      for (int k = 0; k < 3; ++k) {
        matrix_bar[c][k] = select(present, four_over_dx * affine_bar[c][k], zero);
      }
    }
    for (int c = 0; c < 3; ++c) {
      for (int j = 0; j < 3; ++j) {
        place_bar[j] = fma(velocity_bar[c], moved[c].value_by[j], place_bar[j]);
        for (int k = 0; k < 3; ++k) {
          place_bar[j] = fma(matrix_bar[c][k], moved[c].affine_by[k][j], place_bar[j]);
        }
      }
    }
    scatter<3, true, T>(out_, slab, lane, affine_stencil(f), velocity_bar, matrix_bar);

    const T inverse_dx = T(S(1) / view_.dx);
    for (int c = 0; c < 3; ++c) {
      set_bar(bars, kPosition + c, inverse_dx * place_bar[c]);
      set_bar(bars, kVelocity + c, zero);
    }
    for (int i = 0; i < 9; ++i)
      set_bar(bars, kH + static_cast<std::size_t>(i), before_bar[i / 3][i % 3]);
    set_bar(bars, kStrain, law_bar.strain);
    store_bars(chunk, lane, bars);
  }

  /// The cotangents of the nodes around the particles' new places; for the few that change cell one
  /// by one.
  template <class Mask>
  Landing land(std::size_t slab, std::size_t lane, const mpm::KeptChunk<S>& chunk, Mask present,
               T landed[3], CellPlace<T>& place) const {
    auto inside = present;
    for (int c = 0; c < 3; ++c) {
      inside = hn::And(inside, hn::Not(landed[c] < scalar<T>(0.5)));
      inside = hn::And(inside, landed[c] < scalar<T>(1.5));
    }
    const auto leaving = hn::AndNot(inside, present);
    HWY_ALIGN S gone[kLanes];
    HWY_ALIGN S at[3 * kLanes];
    const bool any_leave = !hn::AllFalse(D(), leaving);
    if (any_leave) {
      select(leaving, scalar<T>(1), scalar<T>(0)).store(gone);
      for (std::size_t c = 0; c < 3; ++c) {
        landed[c].store(at + c * kLanes);
        landed[c] = select(inside, landed[c], scalar<T>(1));
      }
    }
    place = cell_place(landed);
    Landing out;
    for (std::size_t c = 0; c < 3; ++c) {
      out.momentum[c] = spline_sums(place, expanded(node_bar_ + c * kExpanded, slab, lane));
    }
    const SplineSums<T> mass = spline_sums(place, expanded(node_bar_ + 3 * kExpanded, slab, lane));
    out.mass = mass.www;
    out.mass_by[0] = mass.dww;
    out.mass_by[1] = mass.wdw;
    out.mass_by[2] = mass.wwd;
    if (!any_leave) return out;
    HWY_ALIGN S lanes[(3 * kSplineSums + 4) * kLanes];
    each(out, [&](T& entry, std::size_t i) { entry.store(lanes + i * kLanes); });
    for (std::size_t l = 0; l < kWidth; ++l) {
      if (!(gone[l] > S(0)) || !(chunk.a[Chunk::kVolume][lane + l] > S(0))) continue;
      const std::size_t cell_lane = lane + l;
      int cell[3] = {static_cast<int>(slab), static_cast<int>(cell_lane / 4),
                     static_cast<int>(cell_lane % 4)};
      S own[3];
      for (std::size_t c = 0; c < 3; ++c) {
        own[c] = at[c * kLanes + l];
        const int move = own[c] < S(0.5) ? -1 : own[c] < S(1.5) ? 0 : 1;
        own[c] -= static_cast<S>(move);
        cell[c] += move;
        at[c * kLanes + l] = own[c];
      }
      const CellPlace<S> there = cell_place<S>(own);
      for (std::size_t c = 0; c < 4; ++c) {
        const SplineSums<S> sums =
            spline_sums<S>(there, [&](std::size_t i, std::size_t j, std::size_t k) {
              return node_bar(c, cell[0] + static_cast<int>(i), cell[1] + static_cast<int>(j),
                              cell[2] + static_cast<int>(k));
            });
        put_lane(sums, c, l, lanes);
      }
    }
    each(out, [&](T& entry, std::size_t i) { entry = T::load(lanes + i * kLanes); });
    for (std::size_t c = 0; c < 3; ++c) {
      landed[c] = select(leaving, T::load(at + c * kLanes), landed[c]);
    }
    place = cell_place(landed);
    return out;
  }

  template <class Visit>
  static void each(Landing& landing, const Visit& visit) {
    std::size_t i = 0;
    for (SplineSums<T>& s : landing.momentum) {
      for (T* entry : entries(s)) visit(*entry, i++);
    }
    visit(landing.mass, i++);
    for (T& entry : landing.mass_by) visit(entry, i++);
  }
  template <class Number>
  static std::array<Number*, kSplineSums> entries(SplineSums<Number>& s) {
    return {&s.www, &s.dww, &s.wdw, &s.wwd, &s.sww, &s.wsw, &s.wws, &s.ddw,
            &s.dwd, &s.wdd, &s.sdw, &s.dsw, &s.swd, &s.dws, &s.wsd, &s.wds};
  }
  static void put_lane(SplineSums<S> sums, std::size_t component, std::size_t lane, S* lanes) {
    const auto from = entries(sums);
    const std::size_t count = component < 3 ? kSplineSums : 4;  // of the mass: value and slopes
    for (std::size_t i = 0; i < count; ++i) {
      lanes[(component * kSplineSums + i) * kLanes + lane] = *from[i];
    }
  }

  /// Node (x, y, z) of the block, each −1…6.
  [[nodiscard]] S node_bar(std::size_t component, int x, int y, int z) const {
    const auto step = [](int n) { return n < 0 ? 0 : n > 3 ? 2 : 1; };
    const S* nodes = view_.node_bar[9 * step(x) + 3 * step(y) + step(z)];
    if (nodes == nullptr) return S(0);
    const auto inner = [](int n) { return static_cast<std::size_t>(n & 3); };
    return nodes[component * kBlockNodes + mpm::node_index(inner(x), inner(y), inner(z))];
  }

  /// Nodes of a register's cells.
  [[nodiscard]] static auto expanded(const S* component, std::size_t slab, std::size_t lane) {
    return [=](std::size_t i, std::size_t j, std::size_t k) {
      return T::load(component + mpm::expanded_index(slab + i, j, k) + lane);
    };
  }

  // --- particles' cotangents, which lie by particle
  // -----------------------------------------------

  static constexpr std::size_t kPosition = 0;
  static constexpr std::size_t kVelocity = 3;
  static constexpr std::size_t kH = 6;
  static constexpr std::size_t kStrain = 15;

  static T bar(const S* bars, std::size_t i) { return T::load(bars + i * kLanes); }
  static void set_bar(S* bars, std::size_t i, T value) { value.store(bars + i * kLanes); }

  /// They lie all over the memory, and are needed a register later.
  void fetch_bars(const mpm::KeptChunk<S>& chunk) const {
    for (std::size_t l = 0; l < kLanes; ++l) hwy::Prefetch(&view_.particle_bar[chunk.id[l]]);
  }

  /// Numbers of one particle after another, a few particles at a time.
  static constexpr std::size_t kTogether = std::min<std::size_t>(4, kWidth);
  static_assert(sizeof(mpm::UpdatedParticleBar<S>) == kBars * sizeof(S) && kWidth % kTogether == 0);

  void load_bars(const mpm::KeptChunk<S>& chunk, std::size_t lane, S* bars) const {
    HWY_ALIGN S particles[kTogether * kBars];
    for (std::size_t l = 0; l < kWidth; l += kTogether) {
      for (std::size_t n = 0; n < kTogether; ++n) {
        const std::size_t at = lane + l + n;
        if (chunk.a[Chunk::kVolume][at] > S(0)) {
          std::memcpy(particles + n * kBars, &view_.particle_bar[chunk.id[at]], kBars * sizeof(S));
        } else {
          std::fill_n(particles + n * kBars, kBars, S(0));
        }
      }
      for (std::size_t i = 0; i < kBars; i += 4) {
        transpose<kTogether, 4>(particles + i, kBars, bars + i * kLanes + l, kLanes);
      }
    }
  }
  void store_bars(const mpm::KeptChunk<S>& chunk, std::size_t lane, const S* bars) const {
    HWY_ALIGN S particles[kTogether * kBars];
    for (std::size_t l = 0; l < kWidth; l += kTogether) {
      for (std::size_t i = 0; i < kBars; i += 4) {
        transpose<4, kTogether>(bars + i * kLanes + l, kLanes, particles + i, kBars);
      }
      for (std::size_t n = 0; n < kTogether; ++n) {
        const std::size_t at = lane + l + n;
        if (!(chunk.a[Chunk::kVolume][at] > S(0))) continue;
        std::memcpy(static_cast<void*>(&view_.particle_bar[chunk.id[at]]), particles + n * kBars,
                    kBars * sizeof(S));
      }
    }
  }

  [[nodiscard]] Sym3<T> load_branch(const S* all, const mpm::KeptChunk<S>& chunk, std::size_t lane,
                                    std::size_t branch) const {
    HWY_ALIGN S state[6 * kLanes] = {};
    for (std::size_t l = 0; l < kWidth; ++l) {
      if (!(chunk.a[Chunk::kVolume][lane + l] > S(0))) continue;
      const S* from = all + (chunk.id[lane + l] * law_.maxwell_count + branch) * 6;
      for (std::size_t c = 0; c < 6; ++c) state[c * kLanes + l] = from[c];
    }
    return load_sym3<T>(state, kLanes);
  }
  void store_branch(const Sym3<T>& value, const mpm::KeptChunk<S>& chunk, std::size_t lane,
                    std::size_t branch) const {
    HWY_ALIGN S state[6 * kLanes];
    store_sym3(value, state, kLanes);
    for (std::size_t l = 0; l < kWidth; ++l) {
      if (!(chunk.a[Chunk::kVolume][lane + l] > S(0))) continue;
      S* to = view_.maxwell_bar + (chunk.id[lane + l] * law_.maxwell_count + branch) * 6;
      for (std::size_t c = 0; c < 6; ++c) to[c] = state[c * kLanes + l];
    }
  }

  mpm::UpdatedAdjointView<S>& view_;
  const material::LawConstants<S>& law_;
  MaxwellStep<S> relaxation_[material::kMostMaxwellBranches];
  MaxwellStepBar<T> relaxation_bar_[material::kMostMaxwellBranches] = {};
  ConstantsBar<T> constants_bar_{};
  T log_density_ = scalar<T>(0);
  std::conditional_t<kPublished, PublishedBack<T, S>, NotPublished> published_;
  HWY_ALIGN S velocity_[3 * kExpanded];
  HWY_ALIGN S node_bar_[4 * kExpanded];
  HWY_ALIGN S out_[3 * kExpanded] = {};
};

template <class S>
void updated_block_adjoint(mpm::UpdatedAdjointView<S>& view) {
  material::dispatch(material::traits(view.law.law).family, [&]<StressFamily kFamily>() HWY_ATTR {
    UpdatedBlockAdjoint<kFamily, S>(view).run();
  });
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
