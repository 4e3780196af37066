// SPDX-License-Identifier: GPL-3.0-or-later
// Pre-training of neural laws on classical ones: accuracy, determinism, and what the flow keeps.
#include "material/neural/pretrain.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <sstream>
#include <string>

#include "base/error.hpp"
#include "material/neural/isotropic_principal.hpp"
#include "material/neural/net_training.hpp"

namespace matterfit::material {
namespace {

std::string summary(const LawAccuracy& a) {
  std::ostringstream out;
  out << "uniaxial";
  for (const double error : a.uniaxial) out << ' ' << error;
  out << ", stress " << a.stress << ", flow " << a.flow << " of steps " << a.flow_step;
  return out.str();
}

/// On fewer samples than a user's, which is as accurate here.
IsotropicWeights pretrained(StartLaw law) {
  Pretraining options;
  options.fit_samples = 400;
  return pretrain_isotropic(start_material(law), options);
}

TEST(Pretrain, IsotropicLawGivesUniaxialStressWithinOnePercent) {
  Arena arena(2);
  for (const StartLaw law : kStartLaws) {
    const Material material = start_material(law);
    const LawAccuracy a = accuracy(pretrained(law), material, 9, arena);
    RecordProperty(std::string(start_law_name(law)), summary(a));
    for (const double error : a.uniaxial) EXPECT_LT(std::abs(error), 0.01) << start_law_name(law);
    EXPECT_LT(a.stress, 0.03) << start_law_name(law);
    EXPECT_LT(a.flow, 0.02 * a.flow_step + 1e-4) << start_law_name(law);
  }
}

TEST(Pretrain, SameSeedSameWeights) {
  const Material jelly = start_material(StartLaw::kJelly);
  Pretraining options;
  options.fit_samples = 200;
  const IsotropicWeights weights = pretrain_isotropic(jelly, options);
  EXPECT_EQ(weights, pretrain_isotropic(jelly, options));
  options.seed = 2;
  EXPECT_NE(weights, pretrain_isotropic(jelly, options));
}

TEST(Pretrain, PublishedFormLearnsAndDoesNotDependOnThreads) {
  const Material plasticine = start_material(StartLaw::kPlasticine);
  Pretraining options;
  options.samples = std::size_t{1} << 14U;
  options.passes = 12;
  options.batch = 128;
  Arena one(1);
  Arena three(3);
  const PublishedWeights weights = pretrain_published(plasticine, options, one);
  const PublishedWeights again = pretrain_published(plasticine, options, three);
  EXPECT_EQ(weights.elastic, again.elastic);
  EXPECT_EQ(weights.plastic, again.plastic);
  const LawAccuracy a = accuracy(weights, plasticine, 9, one);
  RecordProperty("plasticine", summary(a));
  EXPECT_LT(a.stress, 0.25);
  EXPECT_LT(a.flow, 0.5 * a.flow_step);
}

TEST(Pretrain, ElasticMaterialKeepsItsStrain) {
  Arena arena(2);
  Pretraining options;
  options.samples = 1024;
  options.passes = 1;
  const PublishedWeights weights =
      pretrain_published(start_material(StartLaw::kJelly), options, arena);
  const LawAccuracy a = accuracy(weights, start_material(StartLaw::kJelly), 9, arena);
  EXPECT_LT(a.flow, 1e-12);
}

TEST(Pretrain, SandKeepsNoTensionAndYieldsAtItsCone) {
  const Material sand = start_material(StartLaw::kSand);
  const IsotropicWeights weights = pretrained(StartLaw::kSand);
  for (const Vec3d& trial : {Vec3d(0.01, 0.02, 0.005), Vec3d(-0.03, -0.01, -0.02),
                             Vec3d(0.02, -0.06, 0.01), Vec3d(-0.05, -0.05, -0.05)}) {
    double plastic = 0.0;
    const Vec3d kept = principal_flow(weights, trial, 1e-4, plastic);
    EXPECT_LT((kept - principal_sample(sand, trial).kept).norm(), 2e-4);
  }
}

TEST(Pretrain, TooFewSamplesAreRefused) {
  Arena arena(1);
  EXPECT_THROW((void)train_net({}, {}, arena), Error);
  EXPECT_THROW((void)start_law_from_name("jam"), Error);
}

}  // namespace
}  // namespace matterfit::material
