// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/isotropic_law.hpp"

#include <string>
#include <vector>

#include "base/error.hpp"
#include "material/neural/point_partitions.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "material/neural/isotropic_law.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that it is compiled once per target.
#include "material/neural/isotropic-inl.hpp"
#include "material/neural/point_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

using material::IsotropicConstants;
using material::IsotropicPoints;
using material::IsotropicResults;
using material::IsotropicResultsBar;

template <class T, class S = typename LaneTraits<T>::Scalar>
void isotropic_forward_points(const IsotropicConstants<S>& c, S dt, std::size_t begin,
                              std::size_t end, const IsotropicPoints<S>& points,
                              const IsotropicResults<S>& results) {
  Mat3<T> h[kPanelRegisters<T>];
  T strain[kPanelRegisters<T>];
  Sym3<T> tau[kPanelRegisters<T>];
  for (std::size_t at = begin; at < end; at += kPanel<T>) {
    load_deformations(points.trial.data(), at, end, h);
    load_numbers(points.strain.data(), at, end, strain);
    for (int g = 0; g < kPanelRegisters<T>; ++g) {
      const T jm1 = determinant_minus_one(h[g]);
      Sym3<T> plastic;
      tau[g] = isotropic_stress<T>(c, h[g], jm1, jm1, T(dt), plastic, strain[g]);
      const Mat3<T> f = plus_identity(h[g]);
      h[g] = f;
      add(multiply(f, plastic), h[g]);
    }
    store_matrices(h, results.elastic.data(), at, end);
    store_numbers(strain, results.strain.data(), at, end);
    store_symmetric(tau, results.tau.data(), at, end);
  }
}

/// Adds to `c_bar`.
template <class T, class S = typename LaneTraits<T>::Scalar>
void isotropic_backward_points(const IsotropicConstants<S>& c, S dt, std::size_t begin,
                               std::size_t end, const IsotropicPoints<S>& points,
                               const IsotropicResultsBar<S>& bars, S* trial_bar, S* strain_bar,
                               IsotropicConstants<double>& c_bar) {
  Mat3<T> h[kPanelRegisters<T>];
  Mat3<T> f_bar[kPanelRegisters<T>];
  Mat3<T> out[kPanelRegisters<T>];
  T strain[kPanelRegisters<T>];
  T after_bar[kPanelRegisters<T>];
  Sym3<T> tau_bar[kPanelRegisters<T>];
  for (std::size_t at = begin; at < end; at += kPanel<T>) {
    load_deformations(points.trial.data(), at, end, h);
    load_matrices(bars.elastic.data(), at, end, f_bar);
    load_numbers(points.strain.data(), at, end, strain);
    load_numbers(bars.strain.data(), at, end, after_bar);
    load_symmetric(bars.tau.data(), at, end, tau_bar);
    IsotropicConstants<T> sums{};
    for (int g = 0; g < kPanelRegisters<T>; ++g) {
      const T jm1 = determinant_minus_one(h[g]);
      const Mat3<T> f = plus_identity(h[g]);
      // F_new = F + F plastic, of which the adjoint below has the second factor only.
      Sym3<T> plastic;
      T after = strain[g];
      (void)isotropic_stress<T>(c, h[g], jm1, jm1, T(dt), plastic, after);
      const Sym3<T> plastic_bar = symmetric_part(transpose_multiply(f, f_bar[g]));
      IsotropicBar<T> bar{};
      isotropic_stress_adjoint<T>(c, h[g], jm1, jm1, T(dt), strain[g], tau_bar[g], plastic_bar,
                                  after_bar[g], bar, sums);
      out[g] = bar.h;
      add(f_bar[g], out[g]);
      add(multiply(f_bar[g], plastic), out[g]);
      add_scaled(cofactor(f), bar.jm1 + bar.mean, out[g]);
      strain[g] = bar.strain;
    }
    store_matrices(out, trial_bar, at, end);
    store_numbers(strain, strain_bar, at, end);
    S totals[material::kIsotropicWeights];
    std::size_t count = 0;
    sums.for_each([&](T& entry) { totals[count++] = lanes_total(entry); });
    count = 0;
    c_bar.for_each([&](double& entry) { entry += static_cast<double>(totals[count++]); });
  }
}

using FloatLanes = Lanes<hn::ScalableTag<float>>;

void isotropic_forward_float(const IsotropicConstants<float>& c, float dt, std::size_t begin,
                             std::size_t end, const IsotropicPoints<float>& points,
                             const IsotropicResults<float>& results) {
  isotropic_forward_points<FloatLanes>(c, dt, begin, end, points, results);
}
void isotropic_backward_float(const IsotropicConstants<float>& c, float dt, std::size_t begin,
                              std::size_t end, const IsotropicPoints<float>& points,
                              const IsotropicResultsBar<float>& bars, float* trial_bar,
                              float* strain_bar, IsotropicConstants<double>& c_bar) {
  isotropic_backward_points<FloatLanes>(c, dt, begin, end, points, bars, trial_bar, strain_bar,
                                        c_bar);
}
#if HWY_TARGET == HWY_SSE4
// For proofs.
void isotropic_forward_double(const IsotropicConstants<double>& c, double dt, std::size_t begin,
                              std::size_t end, const IsotropicPoints<double>& points,
                              const IsotropicResults<double>& results) {
  isotropic_forward_points<double>(c, dt, begin, end, points, results);
}
void isotropic_backward_double(const IsotropicConstants<double>& c, double dt, std::size_t begin,
                               std::size_t end, const IsotropicPoints<double>& points,
                               const IsotropicResultsBar<double>& bars, double* trial_bar,
                               double* strain_bar, IsotropicConstants<double>& c_bar) {
  isotropic_backward_points<double>(c, dt, begin, end, points, bars, trial_bar, strain_bar, c_bar);
}
#endif

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace matterfit {

HWY_EXPORT(isotropic_forward_float);
HWY_EXPORT(isotropic_backward_float);

namespace material {
namespace {

void check_size(std::size_t have, std::size_t want, const char* what) {
  if (have != want) {
    throw_input(std::string("isotropic law: ") + what + " has " + std::to_string(have) +
                " values, expected " + std::to_string(want) + ".");
  }
}

}  // namespace

template <class S>
void isotropic_forward(const IsotropicWeights& weights, double dt, const IsotropicPoints<S>& points,
                       const IsotropicResults<S>& results, Arena& arena) {
  const std::size_t count = points.trial.size() / 9;
  check_size(points.strain.size(), count, "strain");
  check_size(results.elastic.size(), 9 * count, "elastic");
  check_size(results.strain.size(), count, "strain after");
  check_size(results.tau.size(), 6 * count, "tau");
  const auto c = isotropic_constants<S>(weights);
  for_partitions(count, arena, [&](std::size_t, std::size_t begin, std::size_t end) {
    if constexpr (sizeof(S) == 4) {
      HWY_DYNAMIC_DISPATCH(isotropic_forward_float)
      (c, static_cast<S>(dt), begin, end, points, results);
    } else {
      N_SSE4::isotropic_forward_double(c, dt, begin, end, points, results);
    }
  });
}

template <class S>
void isotropic_backward(const IsotropicWeights& weights, double dt,
                        const IsotropicPoints<S>& points, const IsotropicResultsBar<S>& bars,
                        std::span<S> trial_bar, std::span<S> strain_bar,
                        std::span<double, kIsotropicWeights> weights_bar, Arena& arena) {
  const std::size_t count = points.trial.size() / 9;
  check_size(points.strain.size(), count, "strain");
  check_size(bars.elastic.size(), 9 * count, "elastic_bar");
  check_size(bars.strain.size(), count, "strain_bar");
  check_size(bars.tau.size(), 6 * count, "tau_bar");
  check_size(trial_bar.size(), 9 * count, "trial_bar");
  check_size(strain_bar.size(), count, "strain_bar");
  const auto c = isotropic_constants<S>(weights);
  std::vector<IsotropicConstants<double>> partial(kPointPartitions);
  for_partitions(count, arena, [&](std::size_t part, std::size_t begin, std::size_t end) {
    if constexpr (sizeof(S) == 4) {
      HWY_DYNAMIC_DISPATCH(isotropic_backward_float)
      (c, static_cast<S>(dt), begin, end, points, bars, trial_bar.data(), strain_bar.data(),
       partial[part]);
    } else {
      N_SSE4::isotropic_backward_double(c, dt, begin, end, points, bars, trial_bar.data(),
                                        strain_bar.data(), partial[part]);
    }
  });
  std::fill(weights_bar.begin(), weights_bar.end(), 0.0);
  for (const IsotropicConstants<double>& part : partial) {
    add_isotropic_weights_adjoint(weights, part, weights_bar);
  }
}

template void isotropic_forward<float>(const IsotropicWeights&, double,
                                       const IsotropicPoints<float>&,
                                       const IsotropicResults<float>&, Arena&);
template void isotropic_forward<double>(const IsotropicWeights&, double,
                                        const IsotropicPoints<double>&,
                                        const IsotropicResults<double>&, Arena&);
template void isotropic_backward<float>(const IsotropicWeights&, double,
                                        const IsotropicPoints<float>&,
                                        const IsotropicResultsBar<float>&, std::span<float>,
                                        std::span<float>, std::span<double, kIsotropicWeights>,
                                        Arena&);
template void isotropic_backward<double>(const IsotropicWeights&, double,
                                         const IsotropicPoints<double>&,
                                         const IsotropicResultsBar<double>&, std::span<double>,
                                         std::span<double>, std::span<double, kIsotropicWeights>,
                                         Arena&);

}  // namespace material
}  // namespace matterfit
#endif
