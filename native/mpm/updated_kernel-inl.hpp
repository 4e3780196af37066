// SPDX-License-Identifier: GPL-3.0-or-later
// The fused substep of the updated Lagrangian formulation, a block at a time. Included once per
// SIMD target.
#if defined(MATTERFIT_MPM_UPDATED_KERNEL_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_UPDATED_KERNEL_INL_HPP
#undef MATTERFIT_MPM_UPDATED_KERNEL_INL_HPP
#else
#define MATTERFIT_MPM_UPDATED_KERNEL_INL_HPP
#endif

#include "mpm/total_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Matrix of the affine momentum for slopes w (x_node − x)/dx: dx m C − dt V D⁻¹ dx τ, D⁻¹ = 4/dx².
template <class T>
HWY_INLINE void affine_momentum(const Mat3<T>& c, const Sym3<T>& tau, T mass_dx, T stress_factor,
                                T out[4][3]) {
  const T t[3][3] = {{tau.xx, tau.xy, tau.xz}, {tau.xy, tau.yy, tau.yz}, {tau.xz, tau.yz, tau.zz}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out[i][j] = fnma(stress_factor, t[i][j], mass_dx * c[i][j]);
}

/// Maxwell branches of a register's particles, whose state lies by particle, not by place.
template <class T, class S>
void relax_particles(const mpm::UpdatedView<S>& view,
                     const MaxwellStep<S> relaxation[material::kMostMaxwellBranches],
                     const std::uint32_t* id, const S* volume, const Mat3<T>& step, Sym3<T>& tau) {
  constexpr std::size_t kWidth = LaneTraits<T>::kCount;
  const std::size_t branches = view.law.maxwell_count;
  HWY_ALIGN S state[6 * kLanes] = {};
  for (std::size_t i = 0; i < branches; ++i) {
    for (std::size_t l = 0; l < kWidth; ++l) {
      if (!(volume[l] > S(0))) continue;
      const S* from = view.maxwell + (id[l] * branches + i) * 6;
      for (std::size_t c = 0; c < 6; ++c) state[c * kLanes + l] = from[c];
    }
    const Sym3<T> next = carry_maxwell<T>(relaxation[i], step, load_sym3<T>(state, kLanes), tau);
    store_sym3(next, state, kLanes);
    for (std::size_t l = 0; l < kWidth; ++l) {
      if (!(volume[l] > S(0))) continue;
      S* to = view.maxwell + (id[l] * branches + i) * 6;
      for (std::size_t c = 0; c < 6; ++c) to[c] = state[c * kLanes + l];
    }
  }
}

/// A register's particles in law_step(). Their history lies in the chunk.
template <class T, class S>
struct UpdatedPointOfLaw {
  static constexpr bool kCrushes = false;
  const mpm::UpdatedView<S>& view;
  const MaxwellStep<S>* relaxation;
  const Mat3<T>& affine;  ///< C [1/s]
  const Mat3<T>& step;    ///< dt C
  mpm::UpdatedChunk<S>& chunk;
  std::size_t lane;

  /// F_trial = (I + dt C) F.
  HWY_INLINE LawTrial<T> trial() const {
    using Chunk = mpm::UpdatedChunk<S>;
    const Mat3<T> h = compose(step, load_mat3<T>(&chunk.a[Chunk::kH][lane]));
    const T jm1 = determinant_minus_one(h);
    return {h, jm1, jm1, jm1, T::load(&chunk.a[Chunk::kStrain][lane])};
  }
  template <StressFamily kFamily>
  HWY_INLINE void keep(const LawStep<T>& taken) const {
    using Chunk = mpm::UpdatedChunk<S>;
    store_mat3(elastic_after<kFamily, T>(view.law, taken), &chunk.a[Chunk::kH][lane]);
    if constexpr (material::has_flow(kFamily)) {
      if (view.law.plastic) taken.strain.store(&chunk.a[Chunk::kStrain][lane]);
    }
  }
  HWY_INLINE bool damped() const { return view.law.damped; }
  HWY_INLINE Mat3<T> velocity_gradient() const { return affine; }
  HWY_INLINE void relax(Sym3<T>& tau) const {
    if (view.maxwell == nullptr) return;
    relax_particles<T>(view, relaxation, chunk.id + lane,
                       &chunk.a[mpm::UpdatedChunk<S>::kVolume][lane], step, tau);
  }
};

template <StressFamily kFamily, class S>
void updated_block_law(mpm::UpdatedView<S>& view) {
  using D = hn::CappedTag<S, kLanes>;
  using T = Lanes<D>;
  using Chunk = mpm::UpdatedChunk<S>;
  constexpr std::size_t kWidth = hn::MaxLanes(D());
  HWY_ALIGN S expanded[3 * kExpanded];
  HWY_ALIGN S out[4 * kExpanded] = {};
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t x = 0; x < 6; ++x) {
      for (std::size_t y = 0; y < 6; ++y) {
        const std::size_t corner = (x / 4) * 4 + (y / 4) * 2;
        const std::size_t row_in_block = c * kBlockNodes + mpm::node_index(x % 4, y % 4, 0);
        const S* low = view.node_velocity[corner] + row_in_block;
        const S* high = view.node_velocity[corner + 1] + row_in_block;
        const S row[6] = {low[0], low[1], low[2], low[3], high[0], high[1]};
        expand_row(row, expanded + c * kExpanded, x, y);
      }
    }
  }
  const T dt = T(view.dt);
  const T four_over_dx = T(S(4) / view.dx);
  const T dt_over_dx = T(view.dt / view.dx);
  const T density = T(view.density);
  const T density_dx = T(view.density * view.dx);
  const T stress_scale = T(view.dt * S(4) / view.dx);
  const T half = scalar<T>(0.5);
  const T one_and_half = scalar<T>(1.5);
  MaxwellStep<S> relaxation[material::kMostMaxwellBranches];
  maxwell_steps(view.law, view.dt, relaxation);
  T low_j = scalar<T>(1);
  T high_j = scalar<T>(1);
  T fastest = scalar<T>(0);
  T broken = scalar<T>(0);
  for (std::size_t slab = 0; slab < kSlabs; ++slab) {
    for (std::uint32_t k = 0; k < view.chunks[slab]; ++k) {
      Chunk& chunk = view.slab[slab][k];
      for (std::size_t lane = 0; lane < kLanes; lane += kWidth) {
        const T volume = T::load(&chunk.a[Chunk::kVolume][lane]);
        const auto present = volume > scalar<T>(0);
        if (none(present, volume)) continue;
        T f[3];
        for (std::size_t c = 0; c < 3; ++c) f[c] = T::load(&chunk.a[Chunk::kF + c][lane]);
        T velocity[3];
        Mat3<T> affine;
        gather<3, true, T>(expanded, slab, lane, affine_stencil(f), velocity, affine.m);
        // Where nobody is F stays I: it would drift to det F < 0, whose logarithm times no volume
        // is not 0.
        const T rate = select(present, four_over_dx, scalar<T>(0));
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) affine[i][j] *= rate;
        auto inside = present;
        for (std::size_t c = 0; c < 3; ++c) {
          const T move = dt_over_dx * velocity[c];
          fastest = max(fastest, select(present, abs(move), scalar<T>(0)));
          f[c] = select(present, f[c] + move, scalar<T>(1));
          inside = hn::And(inside, hn::Not(f[c] < half));
          inside = hn::And(inside, f[c] < one_and_half);
        }
        Mat3<T> step;
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) step[i][j] = dt * affine[i][j];
        const UpdatedPointOfLaw<T, S> point{view, relaxation, affine, step, chunk, lane};
        const LawStep<T> taken = law_step<kFamily, T>(view.law, dt, point);
        const T jm1 = taken.trial.jm1;
        const Sym3<T>& tau = taken.tau;
        low_j = min(low_j, select(present, jm1 + scalar<T>(1), scalar<T>(1)));
        high_j = max(high_j, select(present, jm1 + scalar<T>(1), scalar<T>(1)));
        broken =
            fma(scalar<T>(0), select(present, jm1, scalar<T>(0)), broken);  // NaN of infinity too
        for (std::size_t c = 0; c < 3; ++c) {
          f[c].store(&chunk.a[Chunk::kF + c][lane]);
          velocity[c].store(&chunk.a[Chunk::kVelocity + c][lane]);
        }
        const auto leaving = hn::AndNot(inside, present);
        T staying_volume = volume;
        if (!hn::AllFalse(D(), leaving)) {
          staying_volume = select(inside, volume, scalar<T>(0));
          HWY_ALIGN S gone[kLanes];
          HWY_ALIGN S c_lanes[9 * kLanes];
          HWY_ALIGN S tau_lanes[6 * kLanes];
          select(leaving, scalar<T>(1), scalar<T>(0)).store(gone);
          store_mat3(affine, c_lanes);
          const T stress[6] = {tau.xx, tau.yy, tau.zz, tau.yz, tau.xz, tau.xy};
          for (std::size_t i = 0; i < 6; ++i) stress[i].store(tau_lanes + i * kLanes);
          for (std::size_t l = 0; l < kWidth; ++l) {
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
              crosser.affine[c] = c_lanes[c * kLanes + l];
              crosser.h[c] = chunk.a[Chunk::kH + c][at];
            }
            for (std::size_t c = 0; c < 6; ++c) crosser.stress[c] = tau_lanes[c * kLanes + l];
            crosser.volume = chunk.a[Chunk::kVolume][at];
            crosser.strain = chunk.a[Chunk::kStrain][at];
            view.crossers->push_back(crosser);
          }
          // Leavers scatter nothing from here; keep their weights harmless.
          for (std::size_t c = 0; c < 3; ++c) f[c] = select(inside, f[c], scalar<T>(1));
        }
        const T mass = density * staying_volume;
        T matrix[4][3];
        affine_momentum(affine, tau, density_dx * staying_volume, stress_scale * staying_volume,
                        matrix);
        for (int i = 0; i < 3; ++i) velocity[i] *= mass;
        const Stencil<T> stencil = affine_stencil(f);
        scatter<3, true, T>(out, slab, lane, stencil, velocity, matrix);
        scatter_value<T>(out + 3 * kExpanded, slab, lane, stencil, mass);
      }
    }
  }
  HWY_ALIGN S folded[kHaloNodes];
  for (std::size_t c = 0; c < 4; ++c) {
    fold(out + c * kExpanded, folded);
    S* halo = view.halo + c * kHaloNodes;
    for (std::size_t i = 0; i < kHaloNodes; ++i) halo[i] += folded[i];
  }
  HWY_ALIGN S lanes[4 * kLanes];
  low_j.store(lanes);
  high_j.store(lanes + kLanes);
  fastest.store(lanes + 2 * kLanes);
  broken.store(lanes + 3 * kLanes);
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

template <class S>
void updated_block(mpm::UpdatedView<S>& view) {
  material::dispatch(material::traits(view.law.law).family,
                     [&]<StressFamily kFamily>() HWY_ATTR { updated_block_law<kFamily, S>(view); });
}

template <class S>
void updated_scatter(const mpm::Crosser<S>& p, const int cell[3], S density, S dx, S dt, S* halo) {
  const Stencil<S> s = affine_stencil<S>(p.f);
  Mat3<S> c;
  for (std::size_t i = 0; i < 9; ++i) c.m[i / 3][i % 3] = p.affine[i];
  const Sym3<S> tau{p.stress[0], p.stress[1], p.stress[2], p.stress[3], p.stress[4], p.stress[5]};
  S matrix[4][3];
  affine_momentum<S>(c, tau, density * p.volume * dx, p.volume * dt * S(4) / dx, matrix);
  const S mass = density * p.volume;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t node = mpm::halo_index(static_cast<std::size_t>(cell[0]) + i,
                                                 static_cast<std::size_t>(cell[1]) + j,
                                                 static_cast<std::size_t>(cell[2]) + k);
        const S w = s.w[0][i] * s.w[1][j] * s.w[2][k];
        const S gx = s.g[0][i] * s.w[1][j] * s.w[2][k];
        const S gy = s.w[0][i] * s.g[1][j] * s.w[2][k];
        const S gz = s.w[0][i] * s.w[1][j] * s.g[2][k];
        for (std::size_t a = 0; a < 3; ++a) {
          halo[a * kHaloNodes + node] +=
              w * mass * p.velocity[a] + gx * matrix[a][0] + gy * matrix[a][1] + gz * matrix[a][2];
        }
        halo[3 * kHaloNodes + node] += w * mass;
      }
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
