// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "material/neural/net_training.hpp"
#include "material/neural/pretrain.hpp"

namespace matterfit::material {
namespace {

/// Sizes of targets below this share of their scale count as this.
constexpr double kSmall = 0.01;

Mat3d random_frame(Random& random) {
  // A quaternion uniform on the sphere (Shoemake 1992).
  const double u = random.uniform();
  const double a = 2.0 * M_PI * random.uniform();
  const double b = 2.0 * M_PI * random.uniform();
  const double p = std::sqrt(1.0 - u);
  const double q = std::sqrt(u);
  return Quatd(p * std::sin(a), p * std::cos(a), q * std::sin(b), q * std::cos(b))
      .toRotationMatrix();
}

/// Appends the features of the stretch with principal Hencky strains `strain` in a random frame,
/// and the target with principal values `x`.
void append(const Vec3d& strain, const Vec3d& x, Random& random, NetSamples& to) {
  const Mat3d frame = random_frame(random);
  Vec3d excess = strain.array().unaryExpr([](double e) { return std::expm1(e); });
  const Vec3d c = strain.array().unaryExpr([](double e) { return std::expm1(2.0 * e); });
  const Mat3d green = frame * c.asDiagonal() * frame.transpose();
  const Mat3d target = frame * x.asDiagonal() * frame.transpose();
  std::sort(excess.data(), excess.data() + 3, std::greater<>());
  const auto put = [&](double value) { to.features.push_back(static_cast<float>(value)); };
  for (int i = 0; i < 3; ++i) put(excess[i]);
  for (int i = 0; i < 9; ++i) put(green(i / 3, i % 3));
  put(std::expm1(strain.sum()));
  for (const auto& [i, j] : {std::pair{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}}) {
    to.targets.push_back(static_cast<float>(target(i, j)));
  }
  const double size = x.norm() + kSmall;
  to.weight.push_back(static_cast<float>(1.0 / (size * size)));
}

NetSamples reserved(std::size_t count) {
  NetSamples samples;
  samples.features.reserve(kNetFeatures * count);
  samples.targets.reserve(6 * count);
  samples.weight.reserve(count);
  return samples;
}

/// A net trained on targets in units of `scale`, in their own.
std::vector<float> trained(const NetSamples& samples, double scale, const NetTraining& options,
                           Arena& arena) {
  std::vector<float> net = train_net(samples, options, arena);
  for (std::size_t i = kNetWeights - kNetOutputs * kNetHidden; i < kNetWeights; ++i) {
    net[i] = static_cast<float>(net[i] * scale);
  }
  return net;
}

}  // namespace

PublishedWeights pretrain_published(const Material& material, const Pretraining& options,
                                    Arena& arena) {
  NetTraining training;
  training.passes = options.passes;
  training.batch = options.batch;
  training.seed = options.seed;
  Random random(options.seed);
  PublishedWeights weights;
  {
    const double modulus = material.p_wave_modulus();
    NetSamples samples = reserved(options.samples);
    for (const PrincipalSample& s : elastic_samples(material, options.samples, random)) {
      append(s.trial, s.tau.array() * (-s.trial).array().exp() / modulus, random, samples);
    }
    weights.elastic = trained(samples, modulus, training, arena);
  }
  training.seed = random.next();
  const LawTraits& traits = material.traits();
  if (traits.elastic()) {
    weights.plastic = random_net(training.seed);
    std::fill_n(weights.plastic.end() - kNetOutputs * kNetHidden, kNetOutputs * kNetHidden, 0.0F);
    return weights;
  }
  // A step of 1 % is 10 in units of α.
  constexpr double kStep = 10.0;
  NetSamples samples = reserved(options.samples);
  for (const PrincipalSample& s : flow_samples(material, options.samples, random)) {
    const Vec3d change = s.kept.array().exp() - s.trial.array().exp();
    append(s.trial, change / (kPublishedFlowScale * kStep), random, samples);
  }
  weights.plastic = trained(samples, kStep, training, arena);
  return weights;
}

}  // namespace matterfit::material
