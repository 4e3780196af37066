// SPDX-License-Identifier: GPL-3.0-or-later
// Forces of a total Lagrangian body, a block at a time. Included once per SIMD target.
#if defined(MATTERFIT_MPM_TOTAL_KERNEL_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_TOTAL_KERNEL_INL_HPP
#undef MATTERFIT_MPM_TOTAL_KERNEL_INL_HPP
#else
#define MATTERFIT_MPM_TOTAL_KERNEL_INL_HPP
#endif

#include <limits>
#include <vector>

#include "material/classical/law_step-inl.hpp"
#include "mpm/kernels.hpp"
#include "mpm/transfer-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

using mpm::kBlockNodes;
using mpm::kExpanded;
using mpm::kHaloNodes;
using mpm::kLanes;
using mpm::kSlabs;

/// Node values of a block and its halo, relative to `reference`, expanded. Differences are taken in
/// double: a rigid motion of any size leaves the strains their digits.
template <class S>
void expand_nodes(const double* nodes, const std::uint32_t* block_nodes, const double reference[3],
                  S* HWY_RESTRICT expanded) {
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t x = 0; x < 6; ++x) {
      for (std::size_t y = 0; y < 6; ++y) {
        const std::size_t corner = (x / 4) * 4 + (y / 4) * 2;
        const std::size_t row_in_block = mpm::node_index(x % 4, y % 4, 0);
        const double* place = nodes + c * kBlockNodes + row_in_block;
        const double* low = place + block_nodes[corner] * mpm::kNodeBlock;
        const double* high = place + block_nodes[corner + 1] * mpm::kNodeBlock;
        const S row[6] = {
            static_cast<S>(low[0] - reference[c]),  static_cast<S>(low[1] - reference[c]),
            static_cast<S>(low[2] - reference[c]),  static_cast<S>(low[3] - reference[c]),
            static_cast<S>(high[0] - reference[c]), static_cast<S>(high[1] - reference[c])};
        expand_row(row, expanded + c * kExpanded, x, y);
      }
    }
  }
}

/// Where in a node field's component 0 the middle node of the block's first occupied cell is: what
/// values are taken relative to. It carries mass; a massless one may be anywhere, because it falls
/// for as long as the body is held.
template <class View>
std::size_t reference_node(const View& view, std::size_t block) {
  const std::uint32_t* slabs = view.slab_chunks + block * kSlabs;
  std::size_t x = 0;
  while (x + 1 < kSlabs && slabs[x + 1] == slabs[x]) ++x;
  const auto* volume = view.geometry + (slabs[x] * std::size_t{4} + 3) * kLanes;
  std::size_t lane = 0;
  while (lane + 1 < kLanes && !(volume[lane] > 0)) ++lane;
  const std::size_t a = x + 1;
  const std::size_t b = lane / 4 + 1;
  const std::size_t c = lane % 4 + 1;
  const std::uint32_t nodes = view.block_nodes[block * 8 + (a / 4 * 4 + b / 4 * 2 + c / 4)];
  return nodes * mpm::kNodeBlock + mpm::node_index(a % 4, b % 4, c % 4);
}

inline void reference_value(const double* nodes, std::size_t node, double out[3]) {
  for (std::size_t c = 0; c < 3; ++c) out[c] = nodes[node + c * kBlockNodes];
}

template <class T>
HWY_INLINE void load_place(const typename LaneTraits<T>::Scalar* geometry, T f[3]) {
  for (std::size_t a = 0; a < 3; ++a) f[a] = LaneTraits<T>::load(geometry + a * kLanes);
}

template <class T>
HWY_INLINE Stencil<T> load_gradient_stencil(const typename LaneTraits<T>::Scalar* geometry,
                                            T inverse_dx) {
  T f[3];
  load_place(geometry, f);
  return gradient_stencil(f, inverse_dx);
}

template <class T>
HWY_INLINE Mat3<T> load_mat3(const typename LaneTraits<T>::Scalar* p) {
  Mat3<T> m;
  for (std::size_t i = 0; i < 9; ++i) m.m[i / 3][i % 3] = LaneTraits<T>::load(p + i * kLanes);
  return m;
}

template <class T>
HWY_INLINE void store_mat3(const Mat3<T>& m, typename LaneTraits<T>::Scalar* p) {
  for (std::size_t i = 0; i < 9; ++i) LaneTraits<T>::store(m.m[i / 3][i % 3], p + i * kLanes);
}

/// Zero where nobody is: what the nodes there hold must not make a NaN.
template <class T, class Mask>
HWY_INLINE void keep_present(Mask present, T m[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m[i][j] = select(present, m[i][j], scalar<T>(0));
}

/// L = Ḟ F⁻¹ = Ḟ cof(F)ᵀ / J.
template <class T>
HWY_INLINE Mat3<T> present_gradient(const Mat3<T>& rate, const Mat3<T>& cof, T inverse_j) {
  Mat3<T> l;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      l[i][j] = inverse_j *
                fma(rate[i][0], cof[j][0], fma(rate[i][1], cof[j][1], rate[i][2] * cof[j][2]));
  return l;
}

/// The trial state of a register's particles, of which F = I + `h`: F Fᵖ⁻¹ where the law flows.
template <class T, class S>
HWY_INLINE LawTrial<T> total_trial(const mpm::TotalView<S>& view, std::uint32_t chunk,
                                   std::size_t lane, const Mat3<T>& h, T jm1, T mean) {
  LawTrial<T> trial{h, jm1, mean, jm1, scalar<T>(0)};
  if (view.plastic != nullptr) {
    const S* history = view.plastic + chunk * (10 * kLanes) + lane;
    trial.h = compose(h, load_mat3<T>(history));
    trial.strain = T::load(history + 9 * kLanes);
    if (view.law.own_volume) trial.jm1 = determinant_minus_one(trial.h);
  }
  return trial;
}

/// A register's particles in law_step().
template <bool kDamped, class T, class S>
struct TotalPoint {
  static constexpr bool kCrushes = true;
  const mpm::TotalView<S>& view;
  const MaxwellStep<S>* relaxation;
  const S* expanded_velocity;
  const Stencil<T>& stencil;
  const Mat3<T>& h;  ///< F − I
  T jm1;
  T mean;
  T volume;
  std::uint32_t chunk;
  std::size_t slab;
  std::size_t lane;

  HWY_INLINE LawTrial<T> trial() const {
    return total_trial<T, S>(view, chunk, lane, h, jm1, mean);
  }
  template <StressFamily kFamily>
  HWY_INLINE void keep(const LawStep<T>& taken) const {
    if (view.plastic == nullptr || !view.commit) return;
    S* history = view.plastic + chunk * (10 * kLanes) + lane;
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
    return present_gradient(rate, cofactor(plus_identity(h)), scalar<T>(1) / (jm1 + scalar<T>(1)));
  }
  HWY_INLINE void relax(Sym3<T>& tau) const {
    if (view.maxwell == nullptr) return;
    S* history = view.maxwell + chunk * (12 * view.law.maxwell_count * kLanes) + lane;
    add_maxwell_stress<T>(view.law, relaxation, h, jm1, view.commit, history, kLanes, tau);
  }
};

template <StressFamily kFamily, bool kDamped, class S>
void total_forces_law(const mpm::TotalView<S>& view, std::size_t block) {
  using D = hn::CappedTag<S, kLanes>;
  using T = Lanes<D>;
  constexpr std::size_t kWidth = hn::MaxLanes(D());
  HWY_ALIGN S expanded[3 * kExpanded];
  HWY_ALIGN S expanded_velocity[kDamped ? 3 * kExpanded : 1];
  HWY_ALIGN S out[3 * kExpanded] = {};
  // H and J − 1 of every slot of a register's cells, kept between the mean and the stress.
  static thread_local std::vector<S> slots;

  const std::uint32_t* block_nodes = view.block_nodes + block * 8;
  const std::size_t node = reference_node(view, block);
  double reference[3];
  reference_value(view.displacement, node, reference);
  expand_nodes(view.displacement, block_nodes, reference, expanded);
  if constexpr (kDamped) {
    reference_value(view.velocity, node, reference);
    expand_nodes(view.velocity, block_nodes, reference, expanded_velocity);
  }

  const T inverse_dx = T(S(1) / view.dx);
  const T dt = T(view.dt);
  MaxwellStep<S> relaxation[material::kMostMaxwellBranches];
  maxwell_steps(view.law, view.dt, relaxation);
  T low = scalar<T>(1);
  T high = scalar<T>(1);
  T broken = scalar<T>(0);
  const std::uint32_t first = view.slab_chunks[block * kSlabs];
  const std::uint32_t last = view.slab_chunks[(block + 1) * kSlabs];
  slots.resize((last - first) * std::size_t{10} * kLanes);
  // Σ V and Σ V (J − 1) of each cell of the block.
  HWY_ALIGN S cell_volume[kSlabs * kLanes];
  HWY_ALIGN S cell_change[kSlabs * kLanes];
  for (std::size_t slab = 0; slab < kSlabs; ++slab) {
    const std::uint32_t begin = view.slab_chunks[block * kSlabs + slab];
    const std::uint32_t end = view.slab_chunks[block * kSlabs + slab + 1];
    for (std::size_t lane = 0; lane < kLanes; lane += kWidth) {
      T sum_volume = scalar<T>(0);
      T sum_change = scalar<T>(0);
      for (std::uint32_t chunk = begin; chunk < end; ++chunk) {
        const S* geometry = view.geometry + chunk * (4 * kLanes) + lane;
        const T volume = T::load(geometry + 3 * kLanes);
        const Stencil<T> stencil = load_gradient_stencil<T>(geometry, inverse_dx);
        Mat3<T> h;
        gather<3, false, T>(expanded, slab, lane, stencil, nullptr, h.m);
        keep_present(volume > scalar<T>(0), h.m);
        const T jm1 = determinant_minus_one(h);
        low = min(low, jm1 + scalar<T>(1));
        high = max(high, jm1 + scalar<T>(1));
        broken = fma(scalar<T>(0), jm1, broken);  // NaN of what is not finite
        sum_volume += volume;
        sum_change = fma(volume, jm1, sum_change);
        S* slot = slots.data() + (chunk - first) * (10 * kLanes) + lane;
        store_mat3(h, slot);
        jm1.store(slot + 9 * kLanes);
      }
      sum_volume.store(cell_volume + slab * kLanes + lane);
      sum_change.store(cell_change + slab * kLanes + lane);
    }
  }
  for (std::size_t slab = 0; slab < kSlabs; ++slab) {
    const std::uint32_t begin = view.slab_chunks[block * kSlabs + slab];
    const std::uint32_t end = view.slab_chunks[block * kSlabs + slab + 1];
    for (std::size_t lane = 0; lane < kLanes; lane += kWidth) {
      const T mean_of_cell = T::load(cell_change + slab * kLanes + lane) /
                             max(T::load(cell_volume + slab * kLanes + lane), scalar<T>(1e-37));
      for (std::uint32_t chunk = begin; chunk < end; ++chunk) {
        const S* geometry = view.geometry + chunk * (4 * kLanes) + lane;
        const T volume = T::load(geometry + 3 * kLanes);
        const Stencil<T> stencil = load_gradient_stencil<T>(geometry, inverse_dx);
        const S* slot = slots.data() + (chunk - first) * (10 * kLanes) + lane;
        const Mat3<T> h = load_mat3<T>(slot);
        const T jm1 = T::load(slot + 9 * kLanes);
        const T mean = view.mean_dilatation ? mean_of_cell : jm1;
        const TotalPoint<kDamped, T, S> point{
            view, relaxation, expanded_velocity, stencil, h, jm1, mean, volume, chunk, slab, lane};
        const Sym3<T> tau = law_step<kFamily, T>(view.law, dt, point).tau;
        const Mat3<T> cof = cofactor(plus_identity(h));
        const T inverse_j = scalar<T>(1) / (jm1 + scalar<T>(1));
        // −V P = −V τ F⁻ᵀ = −(V/J) τ cof F; absent particles have V = 0.
        Mat3<T> p = multiply(tau, cof);
        const T factor = -volume * inverse_j;
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) p[i][j] *= factor;
        scatter<3, false, T>(out, slab, lane, stencil, nullptr, p.m);
      }
    }
  }
  S* force = view.force + block * 3 * kHaloNodes;
  for (std::size_t c = 0; c < 3; ++c) fold(out + c * kExpanded, force + c * kHaloNodes);
  HWY_ALIGN S lanes_low[kLanes];
  HWY_ALIGN S lanes_high[kLanes];
  HWY_ALIGN S lanes_broken[kLanes];
  low.store(lanes_low);
  high.store(lanes_high);
  broken.store(lanes_broken);
  S lowest = lanes_low[0];
  S highest = lanes_high[0];
  bool nan = false;
  for (std::size_t i = 0; i < kWidth; ++i) {
    lowest = lanes_low[i] < lowest ? lanes_low[i] : lowest;
    highest = lanes_high[i] > highest ? lanes_high[i] : highest;
    nan = nan || !(lanes_broken[i] == S(0));
  }
  view.extremes[block] = {nan ? -std::numeric_limits<S>::infinity() : lowest, highest};
}

template <class S>
void total_forces(const mpm::TotalView<S>& view, std::size_t block) {
  material::dispatch(material::traits(view.law.law).family, [&]<StressFamily kFamily>() HWY_ATTR {
    if (view.law.damped) {
      total_forces_law<kFamily, true, S>(view, block);
    } else {
      total_forces_law<kFamily, false, S>(view, block);
    }
  });
}

/// A kernel that takes the node field in `velocity` to something and back into the block's halo:
/// slab(expanded, out, slab, lane) gathers from `expanded` and scatters into `out`.
template <class S, class Slab>
HWY_INLINE void through_slabs(const mpm::TotalView<S>& view, std::size_t block, const Slab& slab) {
  constexpr std::size_t kWidth = hn::MaxLanes(hn::CappedTag<S, kLanes>());
  HWY_ALIGN S expanded[3 * kExpanded];
  HWY_ALIGN S out[3 * kExpanded] = {};
  constexpr double kOrigin[3] = {0.0, 0.0, 0.0};
  expand_nodes(view.velocity, view.block_nodes + block * 8, kOrigin, expanded);
  const std::uint32_t* chunks = view.slab_chunks + block * kSlabs;
  for (std::size_t x = 0; x < kSlabs; ++x) {
    if (chunks[x] == chunks[x + 1]) continue;
    for (std::size_t lane = 0; lane < kLanes; lane += kWidth) slab(expanded, out, x, lane);
  }
  S* force = view.force + block * 3 * kHaloNodes;
  for (std::size_t c = 0; c < 3; ++c) fold(out + c * kExpanded, force + c * kHaloNodes);
}

/// Σ w m (v_p + C_p (X_I − X_p)) of a block into its halo: the APIC transfer of the node velocities
/// to the particles and back, at rest positions.
template <class S>
void total_smooth(const mpm::TotalView<S>& view, std::size_t block) {
  using T = Lanes<hn::CappedTag<S, kLanes>>;
  const std::uint32_t* chunks = view.slab_chunks + block * kSlabs;
  through_slabs(view, block,
                [&](const S* expanded, S* out, std::size_t slab, std::size_t lane) HWY_ATTR {
                  for (std::uint32_t chunk = chunks[slab]; chunk < chunks[slab + 1]; ++chunk) {
                    const S* geometry = view.geometry + chunk * (4 * kLanes) + lane;
                    T f[3];
                    load_place(geometry, f);
                    const T mass = T::load(geometry + 3 * kLanes) * T(view.density);
                    const Stencil<T> stencil = affine_stencil(f);
                    T value[3];
                    T affine[3][3];
                    gather<3, true, T>(expanded, slab, lane, stencil, value, affine);
                    for (int c = 0; c < 3; ++c) {
                      value[c] *= mass;
                      // D⁻¹ dx² = 4.
                      for (int a = 0; a < 3; ++a) affine[c][a] *= scalar<T>(4) * mass;
                    }
                    scatter<3, true, T>(out, slab, lane, stencil, value, affine);
                  }
                });
}

/// Values at two Gauss points 1 ± 1/√12 of a cell whose nodes hold n: even ± odd/√48.
template <class T>
HWY_INLINE void to_gauss_points(const T n[3], T& even, T& odd) {
  even = fma(scalar<T>(2.0 / 3.0), n[1], scalar<T>(1.0 / 6.0) * (n[0] + n[2]));
  odd = n[2] - n[0];
}

/// Its transpose.
template <class T>
HWY_INLINE void from_gauss_points(T even, T odd, T n[3]) {
  const T outer = scalar<T>(1.0 / 6.0) * even;
  n[0] = outer - odd;
  n[1] = scalar<T>(2.0 / 3.0) * even;
  n[2] = outer + odd;
}

/// The mass matrix of full cells, m G ⊗ G ⊗ G with G = ½ Σ w wᵀ over two Gauss points: axis by axis
/// into the even and the odd part, and back.
template <class T>
HWY_INLINE void multiply_by_cell_mass(const typename LaneTraits<T>::Scalar* HWY_RESTRICT expanded,
                                      typename LaneTraits<T>::Scalar* HWY_RESTRICT out,
                                      std::size_t slab, std::size_t lane, T mass) {
  using mpm::expanded_index;
  T planes[2][2][3];  // even and odd along z, along y; x
  for (std::size_t i = 0; i < 3; ++i) {
    T rows[2][3];
    for (std::size_t j = 0; j < 3; ++j) {
      T n[3];
      for (std::size_t k = 0; k < 3; ++k) {
        n[k] = LaneTraits<T>::load(expanded + expanded_index(slab + i, j, k) + lane);
      }
      to_gauss_points(n, rows[0][j], rows[1][j]);
    }
    for (std::size_t z = 0; z < 2; ++z) {
      to_gauss_points(rows[z], planes[z][0][i], planes[z][1][i]);
    }
  }
  const T odd_mass = scalar<T>(1.0 / 48.0) * mass;
  const T scale[4] = {mass, odd_mass, scalar<T>(1.0 / 48.0) * odd_mass,
                      scalar<T>(1.0 / 2304.0) * odd_mass};
  for (std::size_t z = 0; z < 2; ++z)
    for (std::size_t y = 0; y < 2; ++y) {
      T even;
      T odd;
      to_gauss_points(planes[z][y], even, odd);
      from_gauss_points(scale[z + y] * even, scale[z + y + 1] * odd, planes[z][y]);
    }
  for (std::size_t i = 0; i < 3; ++i) {
    T rows[2][3];
    for (std::size_t z = 0; z < 2; ++z) {
      from_gauss_points(planes[z][0][i], planes[z][1][i], rows[z]);
    }
    for (std::size_t j = 0; j < 3; ++j) {
      T n[3];
      from_gauss_points(rows[0][j], rows[1][j], n);
      for (std::size_t k = 0; k < 3; ++k) {
        auto* place = out + expanded_index(slab + i, j, k) + lane;
        LaneTraits<T>::store(LaneTraits<T>::load(place) + n[k], place);
      }
    }
  }
}

template <class S>
void total_mass(const mpm::TotalView<S>& view, std::size_t block) {
  using T = Lanes<hn::CappedTag<S, kLanes>>;
  const std::uint32_t* chunks = view.slab_chunks + block * kSlabs;
  through_slabs(
      view, block, [&](const S* expanded, S* out, std::size_t slab, std::size_t lane) HWY_ATTR {
        const T mass =
            T::load(view.full_volume + (block * kSlabs + slab) * kLanes + lane) * T(view.density);
        for (std::size_t c = 0; c < 3; ++c) {
          multiply_by_cell_mass(expanded + c * kExpanded, out + c * kExpanded, slab, lane, mass);
        }
        for (std::uint32_t chunk = chunks[slab]; chunk < chunks[slab + 1]; ++chunk) {
          if (view.has_pieces[chunk] == 0) continue;
          T f[3];
          load_place(view.geometry + chunk * (4 * kLanes) + lane, f);
          const T piece = T::load(view.piece_volume + chunk * kLanes + lane) * T(view.density);
          Stencil<T> stencil;
          for (int a = 0; a < 3; ++a) spline_weights(f[a], stencil.w[a]);
          T value[3];
          gather_values<3, T>(expanded, slab, lane, stencil, value);
          for (std::size_t c = 0; c < 3; ++c) {
            scatter_value(out + c * kExpanded, slab, lane, stencil, piece * value[c]);
          }
        }
      });
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
