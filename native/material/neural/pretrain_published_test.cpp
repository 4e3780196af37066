// SPDX-License-Identifier: GPL-3.0-or-later
// The published law's nets regressed to classical laws: the loss and its gradient, determinism,
// and that a short regression comes near. What the shipped weights reach: job/documents/
// neural_starts_test.cpp.
#include "material/neural/pretrain_published.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.hpp"
#include "material/neural/net_regression.hpp"
#include "material/neural/published_for_test.hpp"

namespace matterfit::material {
namespace {

PublishedPretraining short_training() {
  PublishedPretraining options;
  options.steps = 400;
  options.batch = 256;
  return options;
}

/// Strains of three directions that are turned.
NetSamples few_samples(std::size_t count) {
  Random random(4);
  NetSamples samples;
  for (std::size_t i = 0; i < count; ++i) {
    const double angle = random.between(0.0, 3.0);
    const Mat3d q =
        Eigen::AngleAxisd(angle, Vec3d(1.0, random.uniform(), -1.0).normalized()).matrix();
    const Vec3d strain(random.between(-0.3, 0.3), random.between(-0.3, 0.3),
                       random.between(-0.3, 0.3));
    samples.add(q, strain, 3.0 * strain, 1.0 + random.uniform());
  }
  return samples;
}

TEST(NetRegression, TheLossOfALinearNetIsZeroWhereItIsRight) {
  NetSamples samples;
  const Vec3d strain(0.1, -0.05, 0.02);
  const Mat3d q = Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()).matrix();
  const Vec3d c = (2.0 * strain).array().exp() - 1.0;
  const Vec3d x = 5.0 * c + Vec3d::Constant(2.0 * c.sum());
  samples.add(q, strain, x, 1.0);
  samples.add(q, strain, x + Vec3d(1.0, 0.0, 0.0), 3.0);
  Arena arena(1);
  std::vector<double> gradient(kNetWeights);
  const double loss = net_loss(linear_published(4.0, 5.0, 0.0).elastic, samples, gradient, arena);
  EXPECT_NEAR(loss, 9.0, 1e-2);
}

TEST(NetRegression, GradientMatchesDifferences) {
  const NetSamples samples = few_samples(300);
  std::vector<float> net = noisy_published(4.0, 5.0, 1.0, 0.3, 8).elastic;
  Random random(5);
  std::vector<float> along(kNetWeights);
  for (float& d : along) d = random.uniform() < 0.5 ? -0.03125F : 0.03125F;
  Arena arena(2);
  std::vector<double> gradient(kNetWeights);
  const double at = net_loss(net, samples, gradient, arena);
  double found = 0.0;
  for (std::size_t i = 0; i < kNetWeights; ++i) found += gradient[i] * double(along[i]);
  std::vector<double> unused(kNetWeights);
  const auto loss = [&](float by) {
    std::vector<float> moved = net;
    for (std::size_t i = 0; i < kNetWeights; ++i) moved[i] += by * along[i];
    return net_loss(moved, samples, unused, arena);
  };
  const double expected = (loss(0.01F) - loss(-0.01F)) / 0.02;
  EXPECT_NEAR(found, expected, 2e-3 * std::abs(expected) + 1e-5 * at);
  EXPECT_NE(found, 0.0);
}

TEST(PretrainPublished, SameSeedSameWeightsForAnyThreads) {
  const Material material = start_material(StartLaw::kPlasticine);
  PublishedPretraining options = short_training();
  options.steps = 5;
  Arena one(1);
  Arena three(3);
  const PublishedWeights weights = pretrain_published(material, options, one);
  const PublishedWeights again = pretrain_published(material, options, three);
  EXPECT_EQ(weights.elastic, again.elastic);
  EXPECT_EQ(weights.plastic, again.plastic);
  options.seed = 2;
  EXPECT_NE(weights.elastic, pretrain_published(material, options, one).elastic);
}

TEST(PretrainPublished, AShortRegressionComesNear) {
  Arena arena(2);
  const Material jelly = start_material(StartLaw::kJelly);
  const PublishedAccuracy elastic =
      published_accuracy(pretrain_published(jelly, short_training(), arena), jelly, 9, arena);
  RecordProperty("jelly_stress", std::to_string(elastic.stress));
  EXPECT_LT(elastic.stress, 0.15);
  EXPECT_LT(elastic.flow, 1e-12);  // nothing flows
  const Material sand = start_material(StartLaw::kSand);
  const PublishedAccuracy flowing =
      published_accuracy(pretrain_published(sand, short_training(), arena), sand, 9, arena);
  RecordProperty("sand_flow", std::to_string(flowing.flow));
  EXPECT_LT(flowing.flow, 0.7 * flowing.flow_step);
}

}  // namespace
}  // namespace matterfit::material
