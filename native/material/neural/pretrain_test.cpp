// SPDX-License-Identifier: GPL-3.0-or-later
// Pre-training of neural laws on classical ones: accuracy, determinism, and what the flow keeps.
#include "material/neural/pretrain.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <sstream>
#include <string>

#include "base/error.hpp"
#include "material/neural/isotropic_principal.hpp"

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

TEST(Pretrain, UnknownStartLawIsRefused) { EXPECT_THROW((void)start_law_from_name("jam"), Error); }

}  // namespace
}  // namespace matterfit::material
