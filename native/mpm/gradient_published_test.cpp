// SPDX-License-Identifier: GPL-3.0-or-later
// Gradients of whole runs by the published law's weights, against differences in double.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.hpp"
#include "material/neural/published_for_test.hpp"
#include "material/neural/published_material.hpp"
#include "mpm/gradient_runs_for_test.hpp"

namespace matterfit::mpm {
namespace {

using material::kNetFeatures;
using material::kNetHidden;
using material::kNetWeights;

/// A law with one direction a net, on dyadic grids, so that what is moved in float is what is
/// meant.
std::shared_ptr<const material::PublishedLaw> law_with_directions() {
  constexpr std::size_t kLast = kNetHidden * (kNetFeatures + kNetHidden);
  material::PublishedWeights weights = material::noisy_published(8e4, 5e4, 40.0, 0.25, 3);
  std::vector<std::vector<float>> directions(2, std::vector<float>(2 * kNetWeights, 0.0F));
  Random random(11);
  for (std::size_t i = 0; i < 2 * kNetWeights; ++i) {
    const bool elastic = i < kNetWeights;
    const bool last = i % kNetWeights >= kLast;
    const float unit = last ? (elastic ? 1024.0F : 1.0F) : 1.0F / 64.0F;
    directions[elastic ? 0 : 1][i] = random.uniform() < 0.5 ? -unit : unit;
    float& weight = elastic ? weights.elastic[i] : weights.plastic[i - kNetWeights];
    weight = unit / 1024.0F * std::round(weight / unit * 1024.0F);
  }
  auto law = std::make_shared<material::PublishedLaw>(
      *material::make_published_law(std::move(weights), "test"));
  law->directions = std::move(directions);
  return law;
}

GradientCase published_case() {
  GradientCase run;
  run.formulation = Formulation::kUpdated;
  run.material = material::published_material(law_with_directions());
  run.material.weight_moves = {0.0, 0.0};
  run.ground = true;
  run.frames = 3;
  return run;
}

TEST(GradientPublished, ByWeightsOfAWholeRunMatchesDifferences) {
  const GradientCase run = published_case();
  GradientOptions options;
  options.published_weights = true;
  const Gradient g = run.gradient<double>(options);
  const std::vector<double>& found = g.bodies[0].material.published;
  ASSERT_EQ(found.size(), 2 * kNetWeights);
  for (std::size_t net = 0; net < 2; ++net) {
    const auto loss = [&](double by) {
      GradientCase moved = run;
      moved.material.weight_moves[net] = by;
      return moved.loss(g.schedule);
    };
    double along = 0.0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      along += found[i] * double(run.material.published->directions[net][i]);
    }
    constexpr double kStep = 1.0 / 128.0;
    const double expected =
        (8.0 * (loss(kStep) - loss(-kStep)) - (loss(2.0 * kStep) - loss(-2.0 * kStep))) /
        (12.0 * kStep);
    EXPECT_NE(expected, 0.0);
    const double error = std::abs(along - expected) / std::abs(expected);
    EXPECT_LT(error, 1e-6) << "net " << net << ": difference " << expected << ", adjoint " << along;
    RecordProperty(net == 0 ? "elastic" : "plastic", std::to_string(error));
  }
}

TEST(GradientPublished, NotAskedForIsNotThere) {
  const Gradient g = published_case().gradient<float>();
  EXPECT_TRUE(g.bodies[0].material.published.empty());
}

/// Whether every record is kept or segments are run again.
TEST(GradientPublished, TheSameBitsForThreadsAndBudgets) {
  const GradientCase run = published_case();
  GradientOptions options;
  options.published_weights = true;
  const Gradient one = run.gradient<float>(options, 1);
  EXPECT_EQ(one.recomputed, 0U);
  const Gradient two = run.gradient<float>(options, 2);
  EXPECT_EQ(one.bodies[0].material.published, two.bodies[0].material.published);
  options.memory_budget = one.peak_bytes / 3 * 2;
  const Gradient again = run.gradient<float>(options, 2);
  EXPECT_GT(again.recomputed, 0U);
  EXPECT_EQ(one.bodies[0].material.published, again.bodies[0].material.published);
}

}  // namespace
}  // namespace matterfit::mpm
