// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/published_law.hpp"

#include <cmath>
#include <memory>
#include <string>

#include "base/error.hpp"
#include "material/neural/point_partitions.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "material/neural/published_law.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that it is compiled once per target.
#include "material/neural/point_lanes-inl.hpp"
#include "material/neural/published-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Points [begin, end) of published_forward.
template <class T, class S = typename LaneTraits<T>::Scalar>
void published_forward_points(const S* weights, bool exact, std::size_t begin, std::size_t end,
                              const S* trial, S* elastic, S* tau) {
  const PublishedView<S> law{{weights}, {weights + kNetWeights}, S(material::kPublishedFlowScale)};
  const auto panel = std::make_unique<NetPanel<T>>();
  Mat3<T> h[kPanelRegisters<T>];
  Mat3<T> flowed[kPanelRegisters<T>];
  Mat3<T> stress[kPanelRegisters<T>];
  for (std::size_t at = begin; at < end; at += kPanel<T>) {
    load_deformations(trial, at, end, h);
    if (exact) {
      published_forward_panel<true>(law, h, flowed, stress, *panel);
    } else {
      published_forward_panel<false>(law, h, flowed, stress, *panel);
    }
    for (Mat3<T>& f : flowed) f = plus_identity(f);
    store_matrices(flowed, elastic, at, end);
    store_matrices(stress, tau, at, end);
  }
}

/// Points whose activations wait for the weights' cotangents.
inline constexpr std::size_t kBatchPoints = 128;

/// Points [begin, end) of published_backward; adds to weights_bar.
template <class T, class S = typename LaneTraits<T>::Scalar>
void published_backward_points(const S* weights, bool exact, std::size_t begin, std::size_t end,
                               const S* trial, const S* elastic_bar, const S* tau_bar, S* trial_bar,
                               S* weights_bar) {
  constexpr std::size_t kPanels = kBatchPoints / kPanel<T>;
  const PublishedView<S> law{{weights}, {weights + kNetWeights}, S(material::kPublishedFlowScale)};
  const auto elastic = std::make_unique<NetPanel<T>[]>(kPanels);
  const auto plastic = std::make_unique<NetPanel<T>[]>(kPanels);
  Mat3<T> h[kPanelRegisters<T>];
  Mat3<T> h_bar[kPanelRegisters<T>];
  Mat3<T> stress_bar[kPanelRegisters<T>];
  Mat3<T> out[kPanelRegisters<T>];
  for (std::size_t batch = begin; batch < end; batch += kBatchPoints) {
    std::size_t count = 0;
    for (std::size_t at = batch; count < kPanels && at < end; at += kPanel<T>, ++count) {
      load_deformations(trial, at, end, h);
      load_matrices(elastic_bar, at, end, h_bar);
      load_matrices(tau_bar, at, end, stress_bar);
      if (exact) {
        published_backward_panel<true>(law, h, h_bar, stress_bar, out, elastic[count],
                                       plastic[count]);
      } else {
        published_backward_panel<false>(law, h, h_bar, stress_bar, out, elastic[count],
                                        plastic[count]);
      }
      store_matrices(out, trial_bar, at, end);
    }
    add_weight_cotangents<T>(elastic.get(), count, weights_bar);
    add_weight_cotangents<T>(plastic.get(), count, weights_bar + kNetWeights);
  }
}

using FloatLanes = Lanes<hn::ScalableTag<float>>;

void published_forward_float(const float* weights, bool exact, std::size_t begin, std::size_t end,
                             const float* trial, float* elastic, float* tau) {
  published_forward_points<FloatLanes>(weights, exact, begin, end, trial, elastic, tau);
}
void published_backward_float(const float* weights, bool exact, std::size_t begin, std::size_t end,
                              const float* trial, const float* elastic_bar, const float* tau_bar,
                              float* trial_bar, float* weights_bar) {
  published_backward_points<FloatLanes>(weights, exact, begin, end, trial, elastic_bar, tau_bar,
                                        trial_bar, weights_bar);
}
#if HWY_TARGET == HWY_SSE4
// For proofs.
void published_forward_double(const double* weights, bool exact, std::size_t begin, std::size_t end,
                              const double* trial, double* elastic, double* tau) {
  published_forward_points<double>(weights, exact, begin, end, trial, elastic, tau);
}
void published_backward_double(const double* weights, bool exact, std::size_t begin,
                               std::size_t end, const double* trial, const double* elastic_bar,
                               const double* tau_bar, double* trial_bar, double* weights_bar) {
  published_backward_points<double>(weights, exact, begin, end, trial, elastic_bar, tau_bar,
                                    trial_bar, weights_bar);
}
void published_point_double(const double* weights, double flow, const Mat3<double>& trial,
                            Mat3<double>& elastic, Mat3<double>& tau) {
  const PublishedView<double> law{{weights}, {weights + kNetWeights}, flow};
  NetPanel<double> panel;
  Mat3<double> h[kPanelRegisters<double>] = {trial};
  Mat3<double> flowed[kPanelRegisters<double>];
  Mat3<double> stress[kPanelRegisters<double>];
  published_forward_panel<false>(law, h, flowed, stress, panel);
  elastic = flowed[0];
  tau = stress[0];
}
#endif

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace matterfit {

HWY_EXPORT(published_forward_float);
HWY_EXPORT(published_backward_float);

namespace material {
namespace {

void check_size(std::size_t have, std::size_t want, const char* what) {
  if (have != want) {
    throw_input(std::string("published law: ") + what + " has " + std::to_string(have) +
                " values, expected " + std::to_string(want) + ".");
  }
}

}  // namespace

template <class S>
std::vector<S> joined_weights(const PublishedWeights& weights) {
  check_published_weights(weights, "published law");
  std::vector<S> out;
  out.reserve(2 * kNetWeights);
  out.insert(out.end(), weights.elastic.begin(), weights.elastic.end());
  out.insert(out.end(), weights.plastic.begin(), weights.plastic.end());
  return out;
}

Mat3d published_point(const PublishedWeights& weights, double dt, const Mat3d& trial,
                      Mat3d& elastic) {
  const std::vector<double> w = joined_weights<double>(weights);
  N_SSE4::Mat3<double> h;
  N_SSE4::Mat3<double> after;
  N_SSE4::Mat3<double> stress;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) h[i][j] = trial(i, j) - (i == j ? 1.0 : 0.0);
  N_SSE4::published_point_double(w.data(), published_flow(dt), h, after, stress);
  Mat3d tau;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      elastic(i, j) = after[i][j] + (i == j ? 1.0 : 0.0);
      tau(i, j) = stress[i][j];
    }
  return tau;
}

void check_published_weights(const PublishedWeights& weights, const char* name) {
  const auto check = [&](const std::vector<float>& net, const char* which) {
    if (net.size() != kNetWeights) {
      throw_input(std::string(name) + ": the " + which + " net has " + std::to_string(net.size()) +
                  " weights, expected " + std::to_string(kNetWeights) +
                  " (13 → 64 → 64 → 9 without biases).");
    }
    for (const float weight : net) {
      if (!std::isfinite(weight)) {
        throw_input(std::string(name) + ": the " + which + " net has a weight that is no number.");
      }
    }
  };
  check(weights.elastic, "elastic");
  check(weights.plastic, "plastic");
}

template <class S>
void published_forward(const PublishedWeights& weights, GeluMode mode, std::span<const S> trial,
                       std::span<S> elastic, std::span<S> tau, Arena& arena) {
  check_size(elastic.size(), trial.size(), "elastic");
  check_size(tau.size(), trial.size(), "tau");
  const std::vector<S> w = joined_weights<S>(weights);
  const bool exact = mode == GeluMode::kExact;
  for_partitions(trial.size() / 9, arena, [&](std::size_t, std::size_t begin, std::size_t end) {
    if constexpr (sizeof(S) == 4) {
      HWY_DYNAMIC_DISPATCH(published_forward_float)
      (w.data(), exact, begin, end, trial.data(), elastic.data(), tau.data());
    } else {
      N_SSE4::published_forward_double(w.data(), exact, begin, end, trial.data(), elastic.data(),
                                       tau.data());
    }
  });
}

template <class S>
void published_backward(const PublishedWeights& weights, GeluMode mode, std::span<const S> trial,
                        std::span<const S> elastic_bar, std::span<const S> tau_bar,
                        std::span<S> trial_bar, std::span<double> weights_bar, Arena& arena) {
  check_size(elastic_bar.size(), trial.size(), "elastic_bar");
  check_size(tau_bar.size(), trial.size(), "tau_bar");
  check_size(trial_bar.size(), trial.size(), "trial_bar");
  check_size(weights_bar.size(), 2 * kNetWeights, "weights_bar");
  const std::vector<S> w = joined_weights<S>(weights);
  const bool exact = mode == GeluMode::kExact;
  std::vector<S> partial(partition_count(trial.size() / 9) * 2 * kNetWeights, S(0));
  for_partitions(trial.size() / 9, arena,
                 [&](std::size_t part, std::size_t begin, std::size_t end) {
                   S* sum = partial.data() + part * 2 * kNetWeights;
                   if constexpr (sizeof(S) == 4) {
                     HWY_DYNAMIC_DISPATCH(published_backward_float)
                     (w.data(), exact, begin, end, trial.data(), elastic_bar.data(), tau_bar.data(),
                      trial_bar.data(), sum);
                   } else {
                     N_SSE4::published_backward_double(w.data(), exact, begin, end, trial.data(),
                                                       elastic_bar.data(), tau_bar.data(),
                                                       trial_bar.data(), sum);
                   }
                 });
  sum_partitions<S>(partial, weights_bar);
}

template std::vector<float> joined_weights<float>(const PublishedWeights&);
template std::vector<double> joined_weights<double>(const PublishedWeights&);
template void published_forward<float>(const PublishedWeights&, GeluMode, std::span<const float>,
                                       std::span<float>, std::span<float>, Arena&);
template void published_forward<double>(const PublishedWeights&, GeluMode, std::span<const double>,
                                        std::span<double>, std::span<double>, Arena&);
template void published_backward<float>(const PublishedWeights&, GeluMode, std::span<const float>,
                                        std::span<const float>, std::span<const float>,
                                        std::span<float>, std::span<double>, Arena&);
template void published_backward<double>(const PublishedWeights&, GeluMode, std::span<const double>,
                                         std::span<const double>, std::span<const double>,
                                         std::span<double>, std::span<double>, Arena&);

}  // namespace material
}  // namespace matterfit
#endif
