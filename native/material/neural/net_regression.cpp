// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/net_regression.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "material/neural/point_partitions.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "material/neural/net_regression.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that it is compiled once per target.
#include "material/neural/point_lanes-inl.hpp"
#include "material/neural/published_net-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Points of net_loss whose activations wait for the weights' cotangents.
inline constexpr std::size_t kLossBatch = 128;

/// Samples [begin, end) of net_loss; adds to `sum` (kNetWeights).
double net_loss_samples(const float* net, const material::NetSamples& samples, std::size_t begin,
                        std::size_t end, float* sum) {
  using T = Lanes<hn::ScalableTag<float>>;
  constexpr std::size_t kPanels = kLossBatch / kPanel<T>;
  const NetView<float> view{net};
  const auto panels = std::make_unique<NetPanel<T>[]>(kPanels);
  alignas(64) float x_bar[kNetFeatures * kPanel<T>];
  double loss = 0.0;
  for (std::size_t batch = begin; batch < end; batch += kLossBatch) {
    std::size_t count = 0;
    for (std::size_t at = batch; count < kPanels && at < end; at += kPanel<T>, ++count) {
      NetPanel<T>& panel = panels[count];
      const std::size_t points = std::min(end - at, kPanel<T>);
      std::fill_n(panel.x, kNetFeatures * kPanel<T>, 0.0F);
      for (std::size_t p = 0; p < points; ++p)
        for (std::size_t i = 0; i < kNetFeatures; ++i) {
          panel.x[i * kPanel<T> + p] = samples.features[(at + p) * kNetFeatures + i];
        }
      net_forward<false, true>(view, panel);
      for (std::size_t p = 0; p < kPanel<T>; ++p) {
        float* y = panel.y + p;
        float bar[kNetOutputs] = {};
        for (std::size_t k = 0; p < points && k < kNetOutputs; ++k) {
          const std::size_t mirrored = 3 * (k % 3) + k / 3;
          const float x = 0.5F * (y[k * kPanel<T>] + y[mirrored * kPanel<T>]);
          const float w = samples.weights[at + p];
          const float error = w * (x - samples.targets[(at + p) * kNetOutputs + k]);
          loss += static_cast<double>(error) * static_cast<double>(error);
          bar[k] = 2.0F * w * error;
        }
        for (std::size_t k = 0; k < kNetOutputs; ++k) y[k * kPanel<T>] = bar[k];
      }
      net_backward(view, panel, x_bar);
    }
    add_weight_cotangents<T>(panels.get(), count, sum);
  }
  return loss;
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace matterfit {

HWY_EXPORT(net_loss_samples);

namespace material {

void NetSamples::clear() {
  features.clear();
  targets.clear();
  weights.clear();
}

void NetSamples::add(const Mat3d& q, const Vec3d& strain, const Vec3d& x, double weight) {
  Vec3d stretch = strain.array().exp();
  const Mat3d c = q * stretch.cwiseAbs2().asDiagonal() * q.transpose() - Mat3d::Identity();
  const Mat3d target = q * x.asDiagonal() * q.transpose();
  std::sort(stretch.data(), stretch.data() + 3, std::greater<>());
  for (int i = 0; i < 3; ++i) features.push_back(static_cast<float>(stretch[i] - 1.0));
  for (int k = 0; k < 9; ++k) features.push_back(static_cast<float>(c(k / 3, k % 3)));
  features.push_back(static_cast<float>(std::expm1(strain.sum())));
  for (int k = 0; k < 9; ++k) targets.push_back(static_cast<float>(target(k / 3, k % 3)));
  weights.push_back(static_cast<float>(weight));
}

double net_loss(std::span<const float> net, const NetSamples& samples, std::span<double> gradient,
                Arena& arena) {
  const std::size_t parts = partition_count(samples.size());
  std::vector<float> partial(parts * kNetWeights, 0.0F);
  std::vector<double> losses(parts, 0.0);
  for_partitions(samples.size(), arena, [&](std::size_t part, std::size_t begin, std::size_t end) {
    losses[part] = HWY_DYNAMIC_DISPATCH(net_loss_samples)(net.data(), samples, begin, end,
                                                          partial.data() + part * kNetWeights);
  });
  sum_partitions<float>(partial, gradient);
  double loss = 0.0;
  for (const double one : losses) loss += one;
  return loss;
}

}  // namespace material
}  // namespace matterfit
#endif
