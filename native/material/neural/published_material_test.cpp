// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/published_material.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <vector>

#include "base/error.hpp"
#include "base/parallel.hpp"
#include "material/classical/point_law.hpp"
#include "material/neural/published_file.hpp"
#include "material/neural/published_for_test.hpp"
#include "material/neural/published_law.hpp"

namespace matterfit::material {
namespace {

TEST(PublishedMaterial, ModuliAreThoseOfTheStressAtRest) {
  for (const auto& [lambda, mu] : {std::pair{8e4, 5e4}, {-1e4, 3e4}, {5e6, 2e4}}) {
    const Material m =
        published_material(make_published_law(linear_published(lambda, mu, 40.0), "linear"));
    EXPECT_NEAR(m.lambda(), lambda, 2e-3 * (std::abs(lambda) + mu)) << lambda;
    EXPECT_NEAR(m.mu(), mu, 1e-4 * mu) << lambda;
    EXPECT_GE(m.stiffest_modulus(), 0.999 * (lambda + 2.0 * mu)) << lambda;
    validate(m, "material");
  }
}

TEST(PublishedMaterial, TheStiffestModulusIsThatOfAPull) {
  // Along a pull the stress is (½λ + μ)(s² + 2s)(1 + s), steepest where it is farthest.
  const Material m = published_material(make_published_law(linear_published(8e4, 5e4, 0.0), "x"));
  const double s = 0.1875;  // the middle of the last step to a fifth
  EXPECT_NEAR(m.stiffest_modulus(), 9e4 * ((2.0 * s + 2.0) * (1.0 + s) + s * s + 2.0 * s), 2e2);
}

TEST(PublishedMaterial, WeightsThatHoldNothingAreRefused) {
  PublishedWeights none;
  none.elastic.assign(kNetWeights, 0.0F);
  none.plastic.assign(kNetWeights, 0.0F);
  try {
    (void)make_published_law(none, "soft.safetensors");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_THAT(error.what(), testing::HasSubstr("soft.safetensors: these weights hold no body"));
  }
  EXPECT_THROW((void)make_published_law(linear_published(1e4, -1e4, 0.0), "x"), Error);
  Material m = published_material(make_published_law(linear_published(1e4, 1e4, 0.0), "x"));
  m.published.reset();
  EXPECT_THROW(validate(m, "material"), Error);
}

TEST(PublishedMaterial, APointIsOneOfManyAndFlowsInProportionToItsStep) {
  Arena arena(1);
  const PublishedWeights weights = noisy_published(8e4, 5e4, 40.0, 0.1, 3);
  Mat3d f;
  f << 1.1, 0.2, -0.1, 0.05, 0.9, 0.15, -0.05, 0.1, 1.05;
  Mat3d elastic;
  const Mat3d tau = published_point(weights, kPublishedSubstep, f, elastic);
  using Row = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Row trial = f;
  Row kept;
  Row stress;
  published_forward<double>(weights, GeluMode::kPolynomial, {trial.data(), 9}, {kept.data(), 9},
                            {stress.data(), 9}, arena);
  EXPECT_LT((elastic - kept).norm(), 1e-13);
  EXPECT_LT((tau - stress).norm(), 1e-12 * tau.norm());
  EXPECT_GT((tau - tau.transpose()).norm(), 1e-3 * tau.norm());
  Mat3d half;
  (void)published_point(weights, 0.5 * kPublishedSubstep, f, half);
  EXPECT_LT((half - f - 0.5 * (elastic - f)).norm(), 1e-12);
  EXPECT_GT((elastic - f).norm(), 1e-3);
}

TEST(PublishedMaterial, APointLawHasItsDampingAndItsBranchesBesideIt) {
  const PublishedWeights weights = noisy_published(8e4, 5e4, 40.0, 0.1, 3);
  Material m = published_material(make_published_law(weights, "noisy"));
  m.damping_shear = 3.0;
  m.maxwell = {{1e4, 1e-3}};
  const double dt = 3e-4;
  Mat3d step;
  step << 1.01, 0.02, 0.0, 0.01, 0.99, 0.0, 0.0, 0.0, 1.0;
  PointState state;
  const Mat3d tau = PointLaw(m, dt).advance(step, state);
  Mat3d elastic;
  const Mat3d own = published_point(weights, dt, step, elastic);
  EXPECT_LT((state.elastic - elastic).norm(), 1e-14);
  Material beside = m;
  beside.law = Law::kStvkHencky;
  beside.published.reset();
  PointState other;
  Mat3d rest = PointLaw(beside, dt).advance(step, other);
  beside.damping_shear = 0.0;
  beside.maxwell.clear();
  PointState bare;
  rest -= PointLaw(beside, dt).advance(step, bare);
  EXPECT_LT((tau - own - rest).norm(), 1e-10 * tau.norm());
  EXPECT_GT(rest.norm(), 1e-3 * tau.norm());
}

TEST(PublishedMaterial, PublishedWeightsAreAboutAsStiffAsWhatTheyWereTrainedOn) {
  const std::filesystem::path folder = std::filesystem::path(MATTERFIT_DATA_DIR) / "nclaw_weights";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const auto e_of = [&](const char* name) {
    const auto law = make_published_law(read_published_pt(folder / name), name);
    RecordProperty(std::string(name) + " E", std::to_string(law->youngs_modulus));
    RecordProperty(std::string(name) + " nu", std::to_string(law->poisson_ratio));
    RecordProperty(std::string(name) + " wave", std::to_string(law->wave_modulus));
    return law->youngs_modulus;
  };
  // E of what each was trained on.
  EXPECT_NEAR(e_of("jelly_0300.pt"), 1e5, 2e4);
  EXPECT_NEAR(e_of("plasticine_0300.pt"), 3e5, 1.5e5);
  // At rest sand's is far softer in shear than E 1e6 Pa.
  EXPECT_NEAR(e_of("sand_0300.pt"), 3.5e5, 1e5);
}

}  // namespace
}  // namespace matterfit::material
