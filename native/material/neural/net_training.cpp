// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/net_training.hpp"

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <span>

#include "base/error.hpp"
#include "base/random.hpp"
#include "material/neural/point_partitions.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "material/neural/net_training.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that it is compiled once per target.
#include "material/neural/point_lanes-inl.hpp"
#include "material/neural/published-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

/// Adds to `weights_bar` the gradient of ½ Σ weight · |X − target|² over samples [begin, end), and
/// returns that.
double train_points(const float* weights, const material::NetSamples& samples, std::size_t begin,
                    std::size_t end, float* weights_bar) {
  using T = Lanes<hn::ScalableTag<float>>;
  constexpr std::size_t kPanels = material::kPartitionPoints / kPanel<T>;
  const NetView<float> net{weights};
  const auto panels = std::make_unique<NetPanel<T>[]>(kPanels);
  alignas(64) float x_bar[kNetFeatures * kPanel<T>];
  double loss = 0.0;
  for (std::size_t batch = begin; batch < end; batch += material::kPartitionPoints) {
    std::size_t count = 0;
    for (std::size_t at = batch; count < kPanels && at < end; at += kPanel<T>, ++count) {
      NetPanel<T>& panel = panels[count];
      T features[kPanelRegisters<T>][kNetFeatures];
      Sym3<T> target[kPanelRegisters<T>];
      T weight[kPanelRegisters<T>];
      load_rows<kNetFeatures, T>(samples.features.data(), at, end, features);
      load_symmetric(samples.targets.data(), at, end, target);
      load_numbers(samples.weight.data(), at, end, weight);
      for (int g = 0; g < kPanelRegisters<T>; ++g)
        for (std::size_t i = 0; i < kNetFeatures; ++i) {
          LaneTraits<T>::store(features[g][i], panel.x + i * kPanel<T> + g * LaneTraits<T>::kCount);
        }
      net_forward<false, true>(net, panel);
      for (int g = 0; g < kPanelRegisters<T>; ++g) {
        const Sym3<T> error =
            scaled(sum(leave_net(panel, g), scaled(target[g], scalar<T>(-1))), weight[g]);
        loss += 0.5 * static_cast<double>(
                          lanes_total(contract(error, error) / max(weight[g], scalar<T>(1e-30))));
        return_to_net(error, panel, g);
      }
      net_backward(net, panel, x_bar);
    }
    add_weight_cotangents<T>(panels.get(), count, weights_bar);
  }
  return loss;
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace matterfit {

HWY_EXPORT(train_points);

namespace material {
namespace {

constexpr double kFirstMoment = 0.9;
constexpr double kSecondMoment = 0.999;

/// Adam's moments and the weights that they move.
class Adam {
 public:
  explicit Adam(const std::vector<float>& start)
      : weights_(start.begin(), start.end()), mean_(start.size()), square_(start.size()) {}

  void step(std::span<const double> gradient, double rate) {
    decay_mean_ *= kFirstMoment;
    decay_square_ *= kSecondMoment;
    const double scale = rate * std::sqrt(1.0 - decay_square_) / (1.0 - decay_mean_);
    for (std::size_t i = 0; i < weights_.size(); ++i) {
      mean_[i] += (1.0 - kFirstMoment) * (gradient[i] - mean_[i]);
      square_[i] += (1.0 - kSecondMoment) * (gradient[i] * gradient[i] - square_[i]);
      weights_[i] -= scale * mean_[i] / (std::sqrt(square_[i]) + 1e-10);
    }
  }
  [[nodiscard]] std::vector<float> weights() const {
    std::vector<float> out;
    out.reserve(weights_.size());
    for (const double weight : weights_) out.push_back(static_cast<float>(weight));
    return out;
  }

 private:
  std::vector<double> weights_;
  std::vector<double> mean_;
  std::vector<double> square_;
  double decay_mean_ = 1.0;
  double decay_square_ = 1.0;
};

}  // namespace

std::vector<float> random_net(std::uint64_t seed) {
  Random random(seed);
  std::vector<float> weights;
  weights.reserve(kNetWeights);
  const auto layer = [&](std::size_t out, std::size_t in) {
    // Uniform, of variance 2/in.
    const double bound = std::sqrt(6.0 / static_cast<double>(in));
    for (std::size_t i = 0; i < out * in; ++i) {
      weights.push_back(static_cast<float>(random.between(-bound, bound)));
    }
  };
  layer(kNetHidden, kNetFeatures);
  layer(kNetHidden, kNetHidden);
  layer(kNetOutputs, kNetHidden);
  return weights;
}

std::vector<float> train_net(const NetSamples& samples, const NetTraining& options, Arena& arena) {
  const std::size_t count = samples.size();
  if (samples.features.size() != count * kNetFeatures || samples.targets.size() != count * 6) {
    throw_input("train_net: features, targets and weights are not of the same samples.");
  }
  if (options.batch == 0 || count < options.batch) {
    throw_input("train_net: " + std::to_string(count) + " samples are fewer than a batch of " +
                std::to_string(options.batch) + ".");
  }
  Adam adam(random_net(options.seed));
  const std::size_t steps = options.passes * (count / options.batch);
  std::vector<float> partial;
  std::array<double, kPointPartitions> losses{};
  std::vector<double> gradient(kNetWeights);
  for (std::size_t step = 0; step < steps; ++step) {
    const std::size_t first = step * options.batch % (count - options.batch + 1);
    const std::vector<float> weights = adam.weights();
    partial.assign(partition_count(options.batch) * kNetWeights, 0.0F);
    losses.fill(0.0);
    for_partitions(options.batch, arena, [&](std::size_t part, std::size_t begin, std::size_t end) {
      losses[part] = HWY_DYNAMIC_DISPATCH(train_points)(
          weights.data(), samples, first + begin, first + end, partial.data() + part * kNetWeights);
    });
    double loss = 0.0;
    for (const double of : losses) loss += of;
    if (!std::isfinite(loss)) {
      throw_compute("train_net: the error is no number at step " + std::to_string(step) +
                    ". Lower the rate.");
    }
    sum_partitions<float>(partial, gradient);
    const double done = static_cast<double>(step) / static_cast<double>(steps);
    const double rate = 0.5 * options.rate * (1.0 + std::cos(std::numbers::pi * done));
    for (double& entry : gradient) entry /= static_cast<double>(options.batch);
    adam.step(gradient, rate);
  }
  return adam.weights();
}

}  // namespace material
}  // namespace matterfit
#endif
