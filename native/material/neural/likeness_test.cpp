// SPDX-License-Identifier: GPL-3.0-or-later
// What a pre-trained law is like: the law that it was pre-trained on, with its numbers.
#include "material/neural/likeness.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "base/error.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/pretrain.hpp"

namespace matterfit::material {
namespace {

using testing::HasSubstr;

Material pretrained(const Material& classical) {
  Pretraining options;
  options.fit_samples = 600;
  auto start = std::make_shared<IsotropicStart>();
  start->weights = pretrain_isotropic(classical, options);
  return isotropic_material(start);
}

Likeness nearest_to(const Material& classical, const Excitation& over = {}) {
  const std::vector<Likeness> found = likenesses(pretrained(classical), over);
  std::string all;
  for (const Likeness& like : found) all += likeness_sentence(like, over) + "\n";
  testing::Test::RecordProperty("laws", all);
  SCOPED_TRACE(all);
  EXPECT_EQ(found.front().material.law, classical.law) << all;
  return found.front();
}

Material elastic(Law law, double youngs, double poisson) {
  Material m;
  m.law = law;
  m.youngs_modulus = youngs;
  m.poisson_ratio = poisson;
  return m;
}

TEST(Likeness, NeoHookean) {
  const Likeness like = nearest_to(elastic(Law::kNeoHookean, 4e4, 0.4));
  EXPECT_NEAR(like.material.youngs_modulus, 4e4, 0.02 * 4e4);
  EXPECT_NEAR(like.material.poisson_ratio, 0.4, 0.02 * 0.4);
  EXPECT_LT(like.stress, 0.03);
  EXPECT_EQ(like.flow, 0.0);
  EXPECT_THAT(likeness_sentence(like, {}), HasSubstr("Most like Neo-Hookean: τ = μ(FFᵀ − I)"));
}

TEST(Likeness, EachOtherElasticLaw) {
  for (const Law law : {Law::kFixedCorotated, Law::kStvkHencky}) {
    const Likeness like = nearest_to(elastic(law, 2e5, 0.3));
    EXPECT_NEAR(like.material.youngs_modulus, 2e5, 0.02 * 2e5);
    EXPECT_NEAR(like.material.poisson_ratio, 0.3, 0.02 * 0.3);
  }
}

TEST(Likeness, Plasticine) {
  Material m = elastic(Law::kVonMises, 3e5, 0.25);
  m.yield_stress = 6000.0;
  const Likeness like = nearest_to(m);
  EXPECT_NEAR(like.material.yield_stress, 6000.0, 0.02 * 6000.0);
  EXPECT_NEAR(like.material.youngs_modulus, 3e5, 0.02 * 3e5);
  EXPECT_LT(like.flow, 0.02);
  EXPECT_GT(like.flowing, 0.3);
}

TEST(Likeness, Paste) {
  Material m = elastic(Law::kHerschelBulkley, 1e5, 0.3);
  m.yield_stress = 500.0;
  m.viscosity = 30.0;
  const Likeness like = nearest_to(m);
  EXPECT_NEAR(like.material.yield_stress, 500.0, 0.05 * 500.0);
  EXPECT_NEAR(like.material.viscosity, 30.0, 0.05 * 30.0);
}

TEST(Likeness, Sand) {
  Material m = elastic(Law::kDruckerPrager, 1e6, 0.2);
  m.friction_angle = 30.0;
  Excitation over;
  over.expansion = 0.0;
  const Likeness like = nearest_to(m, over);
  EXPECT_NEAR(like.material.friction_angle, 30.0, 0.6);
}

TEST(Likeness, Water) {
  Material m;
  m.law = Law::kNewtonian;
  m.bulk_modulus = 1e5;
  m.viscosity = 50.0;
  const Likeness like = nearest_to(m);
  EXPECT_NEAR(like.material.viscosity, 50.0, 0.02 * 50.0);
  EXPECT_NEAR(like.material.bulk_modulus, 1e5, 0.02 * 1e5);
}

TEST(Likeness, SameSeedSameNumbers) {
  const Material neural = pretrained(elastic(Law::kNeoHookean, 4e4, 0.4));
  const auto a = likenesses(neural, {}, 3);
  const auto b = likenesses(neural, {}, 3);
  EXPECT_EQ(a.front().material.youngs_modulus, b.front().material.youngs_modulus);
  EXPECT_EQ(a.front().stress, b.front().stress);
}

TEST(Likeness, AClassicalLawAndAnEmptyRangeAreRefused) {
  EXPECT_THROW((void)likenesses(elastic(Law::kNeoHookean, 4e4, 0.4), {}), Error);
  Excitation none;
  none.strain = 0.0;
  Material neural = elastic(Law::kNeuralIsotropic, 4e4, 0.4);
  EXPECT_THROW((void)likenesses(neural, none), Error);
}

}  // namespace
}  // namespace matterfit::material
