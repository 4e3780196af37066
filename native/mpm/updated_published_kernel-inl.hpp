// SPDX-License-Identifier: GPL-3.0-or-later
// A block's substep with the published law, whose nets take a panel of registers at once: so many
// go from the grid to their trial states, through the nets, and back to the grid. Its τ is not
// symmetric and scatters as it is. Included once per SIMD target.
#if defined(MATTERFIT_MPM_UPDATED_PUBLISHED_KERNEL_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_UPDATED_PUBLISHED_KERNEL_INL_HPP
#undef MATTERFIT_MPM_UPDATED_PUBLISHED_KERNEL_INL_HPP
#else
#define MATTERFIT_MPM_UPDATED_PUBLISHED_KERNEL_INL_HPP
#endif

#include "material/neural/published-inl.hpp"
#include "mpm/updated_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Hands on the particles of a register that leave their cells: lanes where `gone` > 0. `affine`
/// [9] and `stress` [6] lie kLanes apart.
template <class S>
HWY_INLINE void send_leavers(const mpm::UpdatedView<S>& view, const mpm::UpdatedChunk<S>& chunk,
                             std::size_t slab, std::uint32_t k, std::size_t lane, std::size_t width,
                             const S* gone, const S* affine, const S* stress) {
  using Chunk = mpm::UpdatedChunk<S>;
  for (std::size_t l = 0; l < width; ++l) {
    if (!(gone[l] > S(0))) continue;
    mpm::Crosser<S> crosser;
    const std::size_t at = lane + l;
    crosser.id = chunk.id[at];
    crosser.chunk = static_cast<std::uint16_t>(k);
    crosser.slab = static_cast<std::uint8_t>(slab);
    crosser.lane = static_cast<std::uint8_t>(at);
    for (std::size_t c = 0; c < 3; ++c) {
      crosser.f[c] = chunk.a[Chunk::kF + c][at];
      crosser.velocity[c] = chunk.a[Chunk::kVelocity + c][at];
    }
    for (std::size_t c = 0; c < 9; ++c) {
      crosser.affine[c] = affine[c * kLanes + l];
      crosser.h[c] = chunk.a[Chunk::kH + c][at];
    }
    for (std::size_t c = 0; c < 6; ++c) crosser.stress[c] = stress[c * kLanes + l];
    crosser.volume = chunk.a[Chunk::kVolume][at];
    crosser.strain = chunk.a[Chunk::kStrain][at];
    view.crossers->push_back(crosser);
  }
}

/// What a block's registers have seen, lane by lane.
template <class T>
struct SeenLanes {
  T low_j;
  T high_j;
  T fastest;
  T broken;  ///< 0, or NaN
};

template <class T, class S>
HWY_INLINE void store_seen(const SeenLanes<T>& seen, mpm::UpdatedView<S>& view) {
  constexpr std::size_t kWidth = LaneTraits<T>::kCount;
  HWY_ALIGN S lanes[4 * kLanes];
  seen.low_j.store(lanes);
  seen.high_j.store(lanes + kLanes);
  seen.fastest.store(lanes + 2 * kLanes);
  seen.broken.store(lanes + 3 * kLanes);
  view.extremes = {S(1), S(1)};
  view.fastest = S(0);
  bool nan = false;
  for (std::size_t i = 0; i < kWidth; ++i) {
    view.extremes.min_volume_ratio = std::min(view.extremes.min_volume_ratio, lanes[i]);
    view.extremes.max_volume_ratio = std::max(view.extremes.max_volume_ratio, lanes[kLanes + i]);
    view.fastest = std::max(view.fastest, lanes[2 * kLanes + i]);
    nan = nan || !(lanes[3 * kLanes + i] == S(0));
  }
  if (nan) view.extremes.min_volume_ratio = -std::numeric_limits<S>::infinity();
}

/// Adds a block's expanded momentum and mass to its halo.
template <class S>
HWY_INLINE void fold_out(const S* out, S* halo) {
  HWY_ALIGN S folded[kHaloNodes];
  for (std::size_t c = 0; c < 4; ++c) {
    fold(out + c * kExpanded, folded);
    for (std::size_t i = 0; i < kHaloNodes; ++i) halo[c * kHaloNodes + i] += folded[i];
  }
}

template <class S>
class UpdatedPublishedBlock {
  using D = hn::CappedTag<S, kLanes>;
  using T = Lanes<D>;
  using Chunk = mpm::UpdatedChunk<S>;
  static constexpr std::size_t kWidth = hn::MaxLanes(D());
  static constexpr int kRegs = kPanelRegisters<T>;

 public:
  explicit UpdatedPublishedBlock(mpm::UpdatedView<S>& view)
      : view_(view),
        law_{{view.published},
             {view.published + kNetWeights},
             static_cast<S>(material::published_flow(view.dt))} {
    const T one = scalar<T>(1);
    const T zero = scalar<T>(0);
    seen_ = {one, one, zero, zero};
    maxwell_steps(view.law, view.dt, relaxation_);
    expand_blocks(view.node_velocity, 3, expanded_);
  }

  void run() {
    int count = 0;
    for (std::size_t slab = 0; slab < kSlabs; ++slab) {
      for (std::uint32_t k = 0; k < view_.chunks[slab]; ++k) {
        for (std::size_t lane = 0; lane < kLanes; lane += kWidth) {
          const T volume = T::load(&view_.slab[slab][k].a[Chunk::kVolume][lane]);
          if (none(volume > scalar<T>(0), volume)) continue;
          come(slab, k, lane, waiting_[count], trial_[count]);
          if (++count < kRegs) continue;
          through_nets(count);
          count = 0;
        }
      }
    }
    if (count > 0) through_nets(count);
    fold_out(out_, view_.halo);
    store_seen<T>(seen_, view_);
  }

 private:
  /// A register between the grid and the nets.
  struct Waiting {
    std::size_t slab;
    std::uint32_t k;
    std::size_t lane;
    T volume;
    T f[3];  ///< its new place
    T velocity[3];
    Mat3<T> affine;  ///< C [1/s]
    Mat3<T> step;    ///< dt C
  };

  /// From the grid to the trial state.
  HWY_INLINE void come(std::size_t slab, std::uint32_t k, std::size_t lane, Waiting& w,
                       Mat3<T>& trial) {
    const Chunk& chunk = view_.slab[slab][k];
    const T zero = scalar<T>(0);
    w.slab = slab;
    w.k = k;
    w.lane = lane;
    w.volume = T::load(&chunk.a[Chunk::kVolume][lane]);
    const auto present = w.volume > zero;
    for (std::size_t c = 0; c < 3; ++c) w.f[c] = T::load(&chunk.a[Chunk::kF + c][lane]);
    gather<3, true, T>(expanded_, slab, lane, affine_stencil(w.f), w.velocity, w.affine.m);
    // Where nobody is F stays I.
    const T rate = select(present, T(S(4) / view_.dx), zero);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        w.affine[i][j] *= rate;
        w.step[i][j] = T(view_.dt) * w.affine[i][j];
      }
    for (std::size_t c = 0; c < 3; ++c) {
      const T move = T(view_.dt / view_.dx) * w.velocity[c];
      seen_.fastest = max(seen_.fastest, select(present, abs(move), zero));
      w.f[c] = select(present, w.f[c] + move, scalar<T>(1));
    }
    trial = compose(w.step, load_mat3<T>(&chunk.a[Chunk::kH][lane]));
  }

  void through_nets(int count) {
    for (int g = count; g < kRegs; ++g) trial_[g] = {};
    published_forward_panel<false>(law_, trial_, after_, tau_, panel_);
    for (int g = 0; g < count; ++g) go(waiting_[g], trial_[g], after_[g], tau_[g]);
  }

  /// From the stress to the grid.
  HWY_INLINE void go(Waiting& w, const Mat3<T>& trial, const Mat3<T>& after, Mat3<T>& tau) {
    Chunk& chunk = view_.slab[w.slab][w.k];
    const std::size_t lane = w.lane;
    const T zero = scalar<T>(0);
    const T one = scalar<T>(1);
    const auto present = w.volume > zero;
    const T jm1 = determinant_minus_one(trial);
    seen_.low_j = min(seen_.low_j, select(present, jm1 + one, one));
    seen_.high_j = max(seen_.high_j, select(present, jm1 + one, one));
    seen_.broken = fma(zero, select(present, jm1, zero), seen_.broken);  // NaN of infinity too
    Mat3<T> kept;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) kept[i][j] = select(present, after[i][j], zero);
    store_mat3(kept, &chunk.a[Chunk::kH][lane]);

    const UpdatedPointOfLaw<T, S> point{view_, relaxation_, w.affine, w.step, chunk, lane};
    Sym3<T> beside{};
    add_stress_beside<T>(view_.law, {trial, jm1, jm1, jm1, zero}, point, beside);
    add(to_matrix(beside), tau);

    auto inside = present;
    for (std::size_t c = 0; c < 3; ++c) {
      inside = hn::And(inside, hn::Not(w.f[c] < scalar<T>(0.5)));
      inside = hn::And(inside, w.f[c] < scalar<T>(1.5));
      w.f[c].store(&chunk.a[Chunk::kF + c][lane]);
      w.velocity[c].store(&chunk.a[Chunk::kVelocity + c][lane]);
    }
    // τ acts as if it were momentum of the affine field: dx m C − dt V D⁻¹ dx τ = dx m (C − …).
    const T stress_scale = T(view_.dt * S(4) / (view_.dx * view_.dx * view_.density));
    Mat3<T> moving;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) moving[i][j] = fnma(stress_scale, tau[i][j], w.affine[i][j]);
    const auto leaving = hn::AndNot(inside, present);
    T volume = w.volume;
    if (!hn::AllFalse(D(), leaving)) {
      volume = select(inside, volume, zero);
      HWY_ALIGN S gone[kLanes];
      HWY_ALIGN S affine_lanes[9 * kLanes];
      HWY_ALIGN S no_stress[6 * kLanes] = {};
      select(leaving, one, zero).store(gone);
      store_mat3(moving, affine_lanes);
      send_leavers(view_, chunk, w.slab, w.k, lane, kWidth, gone, affine_lanes, no_stress);
      // Leavers scatter nothing from here; keep their weights harmless.
      for (std::size_t c = 0; c < 3; ++c) w.f[c] = select(inside, w.f[c], one);
    }
    const T mass = T(view_.density) * volume;
    const T mass_dx = T(view_.density * view_.dx) * volume;
    T matrix[4][3];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) matrix[i][j] = mass_dx * moving[i][j];
      w.velocity[i] *= mass;
    }
    const Stencil<T> stencil = affine_stencil(w.f);
    scatter<3, true, T>(out_, w.slab, lane, stencil, w.velocity, matrix);
    scatter_value<T>(out_ + 3 * kExpanded, w.slab, lane, stencil, mass);
  }

  mpm::UpdatedView<S>& view_;
  PublishedView<S> law_;
  SeenLanes<T> seen_;
  MaxwellStep<S> relaxation_[material::kMostMaxwellBranches];
  Waiting waiting_[kRegs];
  Mat3<T> trial_[kRegs];
  Mat3<T> after_[kRegs];
  Mat3<T> tau_[kRegs];
  NetPanel<T> panel_;
  HWY_ALIGN S expanded_[3 * kExpanded];
  HWY_ALIGN S out_[4 * kExpanded] = {};
};

template <class S>
void updated_published_block(mpm::UpdatedView<S>& view) {
  UpdatedPublishedBlock<S>(view).run();
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
