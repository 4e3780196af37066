// SPDX-License-Identifier: GPL-3.0-or-later
// The renewed formulation (renewed_group.hpp), a block at a time: forces between two renewals, how
// far the reference has been left, and the two halves of a renewal. Included once per SIMD target.
#if defined(MATTERFIT_MPM_RENEWED_KERNEL_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_RENEWED_KERNEL_INL_HPP
#undef MATTERFIT_MPM_RENEWED_KERNEL_INL_HPP
#else
#define MATTERFIT_MPM_RENEWED_KERNEL_INL_HPP
#endif

#include <algorithm>
#include <limits>

#include "mpm/renewed_kernels.hpp"
#include "mpm/total_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

using mpm::RenewedCarried;

/// Displacements of a block, or velocities, expanded relative to those of its reference node.
template <class S>
void expand_about(const mpm::RenewedView<S>& view, std::size_t block, const double* field,
                  double reference[3], S* HWY_RESTRICT expanded) {
  reference_value(field, reference_node(view, block), reference);
  expand_nodes(field, view.block_nodes + block * 8, reference, expanded);
}

/// The smallest and the largest lane; −infinity for the first if `broken` has anything but 0.
template <class T, class S>
mpm::BlockExtremes<S> extremes_of(T low, T high, T broken) {
  HWY_ALIGN S lanes[3 * kLanes];
  low.store(lanes);
  high.store(lanes + kLanes);
  broken.store(lanes + 2 * kLanes);
  mpm::BlockExtremes<S> out{S(1), S(1)};
  for (std::size_t i = 0; i < LaneTraits<T>::kCount; ++i) {
    out.min_volume_ratio = std::min(out.min_volume_ratio, lanes[i]);
    out.max_volume_ratio = std::max(out.max_volume_ratio, lanes[kLanes + i]);
  }
  for (std::size_t i = 0; i < LaneTraits<T>::kCount; ++i) {
    if (!(lanes[2 * kLanes + i] == S(0))) {
      out.min_volume_ratio = -std::numeric_limits<S>::infinity();
    }
  }
  return out;
}

/// The trial state of a register's particles: (I + h)(I + G), of a fluid its J. `history` at the
/// reference.
template <StressFamily kFamily, class T, class S>
HWY_INLINE LawTrial<T> renewed_trial(const material::LawConstants<S>& law, const S* history,
                                     const Mat3<T>& h, T jh) {
  if constexpr (kFamily == StressFamily::kNewtonian) {
    const T before = T::load(history);
    const T jm1 = fma(jh, before, jh + before);
    return {h, jm1, jm1, jm1, scalar<T>(0)};
  } else {
    const Mat3<T> elastic = compose(h, load_mat3<T>(history));
    const T jm1 = determinant_minus_one(elastic);
    T strain = scalar<T>(0);
    if (law.plastic) strain = T::load(history + 9 * kLanes);
    return {elastic, jm1, jm1, jm1, strain};
  }
}

/// A register's particles in law_step().
template <StressFamily kFamily, bool kDamped, class T, class S>
struct RenewedPoint {
  static constexpr bool kCrushes = false;
  const mpm::RenewedView<S>& view;
  const MaxwellStep<S>* relaxation;
  const S* expanded_velocity;
  const Stencil<T>& stencil;
  const Mat3<T>& h;  ///< of the motion since the reference, gradient − I
  T jh;              ///< its det − 1
  T volume;
  S* history;
  std::uint32_t chunk;
  std::size_t slab;
  std::size_t lane;

  HWY_INLINE LawTrial<T> trial() const {
    return renewed_trial<kFamily, T, S>(view.law, history, h, jh);
  }
  /// (I+H)(I+G)(I+flow): the flow is on the right, so it is G's.
  template <StressFamily>
  HWY_INLINE void keep(const LawStep<T>& taken) const {
    if constexpr (kFamily == StressFamily::kNewtonian) return;
    if (!view.law.plastic) return;
    store_mat3(flowed(load_mat3<T>(history), taken.flow), history);
    taken.strain.store(history + 9 * kLanes);
  }
  HWY_INLINE bool damped() const { return kDamped; }
  HWY_INLINE Mat3<T> velocity_gradient() const {
    Mat3<T> rate{};
    if constexpr (kDamped) {
      gather<3, false, T>(expanded_velocity, slab, lane, stencil, nullptr, rate.m);
      keep_present(volume > scalar<T>(0), rate.m);
    }
    return present_gradient(rate, cofactor(plus_identity(h)), scalar<T>(1) / (jh + scalar<T>(1)));
  }
  HWY_INLINE void relax(Sym3<T>& tau) const {
    if (view.maxwell == nullptr) return;
    S* branch = view.maxwell + chunk * (12 * view.law.maxwell_count * kLanes) + lane;
    add_maxwell_stress<T>(view.law, relaxation, h, jh, true, branch, kLanes, tau);
  }
};

template <StressFamily kFamily, bool kDamped, class S>
void renewed_forces_law(const mpm::RenewedView<S>& view, std::size_t block) {
  using D = hn::CappedTag<S, kLanes>;
  using T = Lanes<D>;
  constexpr std::size_t kWidth = hn::MaxLanes(D());
  HWY_ALIGN S expanded[3 * kExpanded];
  HWY_ALIGN S expanded_velocity[kDamped ? 3 * kExpanded : 1];
  HWY_ALIGN S out[3 * kExpanded] = {};
  double reference[3];
  expand_about(view, block, view.displacement, reference, expanded);
  if constexpr (kDamped) {
    expand_about(view, block, view.velocity, reference, expanded_velocity);
  }
  const T inverse_dx = T(S(1) / view.dx);
  const T dt = T(view.dt);
  const std::size_t kept = mpm::renewed_history(view.law.law);
  MaxwellStep<S> relaxation[material::kMostMaxwellBranches];
  maxwell_steps(view.law, view.dt, relaxation);
  T low = scalar<T>(1);
  T high = scalar<T>(1);
  T broken = scalar<T>(0);
  for (std::size_t slab = 0; slab < kSlabs; ++slab) {
    const std::uint32_t begin = view.slab_chunks[block * kSlabs + slab];
    const std::uint32_t end = view.slab_chunks[block * kSlabs + slab + 1];
    for (std::uint32_t chunk = begin; chunk < end; ++chunk) {
      for (std::size_t lane = 0; lane < kLanes; lane += kWidth) {
        const S* geometry = view.geometry + chunk * (4 * kLanes) + lane;
        const T volume = T::load(geometry + 3 * kLanes);
        const auto present = volume > scalar<T>(0);
        if (none(present, volume)) continue;
        const Stencil<T> stencil = load_gradient_stencil<T>(geometry, inverse_dx);
        Mat3<T> h;
        gather<3, false, T>(expanded, slab, lane, stencil, nullptr, h.m);
        keep_present(present, h.m);
        const T jh = determinant_minus_one(h);
        S* history = view.history + chunk * (kept * kLanes) + lane;
        const RenewedPoint<kFamily, kDamped, T, S> point{
            view, relaxation, expanded_velocity, stencil, h, jh, volume, history, chunk,
            slab, lane};
        const LawStep<T> taken = law_step<kFamily, T>(view.law, dt, point);
        const T jm1 = taken.trial.jm1;
        low = min(low, jm1 + scalar<T>(1));
        high = max(high, jm1 + scalar<T>(1));
        broken = fma(scalar<T>(0), jm1, broken);  // NaN of what is not finite
        const Mat3<T> cof = cofactor(plus_identity(h));
        const T inverse_j = scalar<T>(1) / (jh + scalar<T>(1));
        // −V τ (I+H)⁻ᵀ = −(V/det) τ cof(I+H); absent particles have V = 0.
        Mat3<T> p = multiply(taken.tau, cof);
        const T factor = -volume * inverse_j;
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) p[i][j] *= factor;
        scatter<3, false, T>(out, slab, lane, stencil, nullptr, p.m);
      }
    }
  }
  S* force = view.halo + block * 4 * kHaloNodes;
  for (std::size_t c = 0; c < 3; ++c) fold(out + c * kExpanded, force + c * kHaloNodes);
  view.extremes[block] = extremes_of<T, S>(low, high, broken);
}

template <class S>
void renewed_forces(const mpm::RenewedView<S>& view, std::size_t block) {
  material::dispatch(material::traits(view.law.law).family, [&]<StressFamily kFamily>() HWY_ATTR {
    if (view.law.damped) {
      renewed_forces_law<kFamily, true, S>(view, block);
    } else {
      renewed_forces_law<kFamily, false, S>(view, block);
    }
  });
}

/// Largest |½(FᵀF − I)| of F = I + H, and the largest way relative to `view.common`.
template <class S>
void renewed_departure(const mpm::RenewedView<S>& view, std::size_t block) {
  using D = hn::CappedTag<S, kLanes>;
  using T = Lanes<D>;
  constexpr std::size_t kWidth = hn::MaxLanes(D());
  HWY_ALIGN S expanded[3 * kExpanded];
  expand_nodes(view.displacement, view.block_nodes + block * 8, view.common, expanded);
  const T inverse_dx = T(S(1) / view.dx);
  T strain = scalar<T>(0);
  T way = scalar<T>(0);
  for (std::size_t slab = 0; slab < kSlabs; ++slab) {
    const std::uint32_t begin = view.slab_chunks[block * kSlabs + slab];
    const std::uint32_t end = view.slab_chunks[block * kSlabs + slab + 1];
    for (std::uint32_t chunk = begin; chunk < end; ++chunk) {
      for (std::size_t lane = 0; lane < kLanes; lane += kWidth) {
        const S* geometry = view.geometry + chunk * (4 * kLanes) + lane;
        const T volume = T::load(geometry + 3 * kLanes);
        const auto present = volume > scalar<T>(0);
        if (none(present, volume)) continue;
        T u[3];
        Mat3<T> h;
        gather<3, true, T>(expanded, slab, lane, load_gradient_stencil<T>(geometry, inverse_dx), u,
                           h.m);
        const Sym3<T> e = right_cauchy_green_minus_identity(h);
        const T normal = fma(e.xx, e.xx, fma(e.yy, e.yy, e.zz * e.zz));
        const T shear = fma(e.yz, e.yz, fma(e.xz, e.xz, e.xy * e.xy));
        const T size = scalar<T>(0.25) * fma(scalar<T>(2), shear, normal);
        strain = max(strain, select(present, size, scalar<T>(0)));
        const T moved = fma(u[0], u[0], fma(u[1], u[1], u[2] * u[2]));
        way = max(way, select(present, moved, scalar<T>(0)));
      }
    }
  }
  HWY_ALIGN S lanes[2 * kLanes];
  strain.store(lanes);
  way.store(lanes + kLanes);
  S strain_squared = S(0);
  S way_squared = S(0);
  for (std::size_t i = 0; i < kWidth; ++i) {
    strain_squared = std::max(strain_squared, lanes[i]);
    way_squared = std::max(way_squared, lanes[kLanes + i]);
  }
  view.departure[block] = {strain_squared, way_squared};
}

/// Particles take place, velocity, C and history from the nodes.
template <class S>
void renewed_leave(const mpm::RenewedView<S>& view, std::size_t block) {
  using D = hn::CappedTag<S, kLanes>;
  using T = Lanes<D>;
  using Carried = RenewedCarried;
  constexpr std::size_t kWidth = hn::MaxLanes(D());
  HWY_ALIGN S expanded[3 * kExpanded];
  HWY_ALIGN S expanded_velocity[3 * kExpanded];
  double reference[3];
  expand_about(view, block, view.displacement, view.moved + 3 * block, expanded);
  expand_about(view, block, view.velocity, reference, expanded_velocity);
  T about[3];
  for (std::size_t c = 0; c < 3; ++c) about[c] = T(static_cast<S>(reference[c] - view.common[c]));
  const T inverse_dx = T(S(1) / view.dx);
  const std::size_t branches = view.law.maxwell_count;
  const std::size_t kept = mpm::renewed_history(view.law.law);
  MaxwellStep<S> still{};  // no time passes
  for (std::size_t slab = 0; slab < kSlabs; ++slab) {
    const std::uint32_t begin = view.slab_chunks[block * kSlabs + slab];
    const std::uint32_t end = view.slab_chunks[block * kSlabs + slab + 1];
    for (std::uint32_t chunk = begin; chunk < end; ++chunk) {
      for (std::size_t lane = 0; lane < kLanes; lane += kWidth) {
        const S* geometry = view.geometry + chunk * (4 * kLanes) + lane;
        const T volume = T::load(geometry + 3 * kLanes);
        const auto present = volume > scalar<T>(0);
        if (none(present, volume)) continue;
        const Stencil<T> stencil = load_gradient_stencil<T>(geometry, inverse_dx);
        T u[3];
        T v[3];
        Mat3<T> h;
        Mat3<T> rate;
        gather<3, true, T>(expanded, slab, lane, stencil, u, h.m);
        gather<3, true, T>(expanded_velocity, slab, lane, stencil, v, rate.m);
        keep_present(present, h.m);
        keep_present(present, rate.m);
        const T jh = determinant_minus_one(h);
        const Mat3<T> c =
            present_gradient(rate, cofactor(plus_identity(h)), scalar<T>(1) / (jh + scalar<T>(1)));
        S* carried = view.carried + chunk * (Carried::kAttributes * kLanes) + lane;
        for (std::size_t a = 0; a < 3; ++a) {
          const T f = fma(u[a], inverse_dx, T::load(geometry + a * kLanes));
          f.store(carried + (Carried::kPlace + a) * kLanes);
          (v[a] + about[a]).store(carried + (Carried::kVelocity + a) * kLanes);
        }
        store_mat3(c, carried + Carried::kAffine * kLanes);
        S* history = view.history + chunk * (kept * kLanes) + lane;
        if (kept == 1) {
          const T before = T::load(history);
          fma(jh, before, jh + before).store(history);
        } else {
          store_mat3(compose(h, load_mat3<T>(history)), history);
        }
        for (std::size_t i = 0; i < branches; ++i) {
          S* branch = view.maxwell + (chunk * branches + i) * (12 * kLanes) + lane;
          Sym3<T> stress{};
          store_sym3(carry_maxwell<T>(still, h, load_sym3<T>(branch, kLanes), stress), branch,
                     kLanes);
          for (std::size_t k = 6; k < 12; ++k) scalar<T>(0).store(branch + k * kLanes);
        }
      }
    }
  }
}

/// Momentum and mass of a block's particles: Σ w m (v + C (x_I − x)), Σ w m.
template <class S>
void renewed_enter(const mpm::RenewedView<S>& view, std::size_t block) {
  using D = hn::CappedTag<S, kLanes>;
  using T = Lanes<D>;
  using Carried = RenewedCarried;
  constexpr std::size_t kWidth = hn::MaxLanes(D());
  HWY_ALIGN S out[4 * kExpanded] = {};
  for (std::size_t slab = 0; slab < kSlabs; ++slab) {
    const std::uint32_t begin = view.slab_chunks[block * kSlabs + slab];
    const std::uint32_t end = view.slab_chunks[block * kSlabs + slab + 1];
    for (std::uint32_t chunk = begin; chunk < end; ++chunk) {
      for (std::size_t lane = 0; lane < kLanes; lane += kWidth) {
        const S* geometry = view.geometry + chunk * (4 * kLanes) + lane;
        const T mass = T::load(geometry + 3 * kLanes) * T(view.density);
        T f[3];
        load_place(geometry, f);
        const S* carried = view.carried + chunk * (Carried::kAttributes * kLanes) + lane;
        T value[3];
        for (std::size_t a = 0; a < 3; ++a) {
          value[a] = mass * T::load(carried + (Carried::kVelocity + a) * kLanes);
        }
        Mat3<T> affine = load_mat3<T>(carried + Carried::kAffine * kLanes);
        const T scale = mass * T(view.dx);
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) affine[i][j] *= scale;
        const Stencil<T> stencil = affine_stencil(f);
        scatter<3, true, T>(out, slab, lane, stencil, value, affine.m);
        scatter_value<T>(out + 3 * kExpanded, slab, lane, stencil, mass);
      }
    }
  }
  S* halo = view.halo + block * 4 * kHaloNodes;
  for (std::size_t c = 0; c < 4; ++c) fold(out + c * kExpanded, halo + c * kHaloNodes);
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
