// SPDX-License-Identifier: GPL-3.0-or-later
// The latent law: its regression, its derivatives, and its files.
#include "material/neural/latent.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/message_for_test.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/pretrain_latent.hpp"

namespace matterfit::material {
namespace {

using testing::HasSubstr;

std::shared_ptr<const LatentDecoder> trained(std::size_t steps, int threads = 2) {
  LatentPretraining options;
  options.materials = 350;
  options.steps = steps;
  Arena arena(threads);
  return pretrain_latent(options, arena);
}

TEST(Latent, ComesNearEveryClassOfMaterials) {
  const auto decoder = trained(4000);
  Arena arena(2);
  // Rounding decides where the regression ends: builds differ by a fifth in the worst of these.
  for (const LatentAccuracy& one : latent_accuracy(decoder, 20, 77, arena)) {
    EXPECT_LT(one.stress, 0.08) << one.name;
    EXPECT_LT(one.yield, 0.3) << one.name;
    EXPECT_GT(one.of_class, 0.9) << one.name;
  }
}

TEST(Latent, SameSeedSameFileForAnyNumberOfThreads) {
  EXPECT_EQ(latent_tensors(*trained(40, 1)).tensors.at("decoder.third").values,
            latent_tensors(*trained(40, 2)).tensors.at("decoder.third").values);
}

TEST(Latent, DerivativesOfTheOutputsMatchDifferences) {
  const auto decoder = trained(200);
  LatentCode code;
  code << 0.3, -0.7, 1.1, 0.2, -1.4, 0.6, 0.1, -0.2;
  Eigen::MatrixXd jacobian;
  (void)latent_output(*decoder, code, &jacobian);
  constexpr double kStep = 1e-3;
  for (Eigen::Index k = 0; k < code.size(); ++k) {
    const auto at = [&](double by) {
      LatentCode moved = code;
      moved[k] += by * kStep;
      return latent_output(*decoder, moved);
    };
    const LatentOutput slope = (8.0 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12.0 * kStep);
    EXPECT_LT((slope - jacobian.col(k)).cwiseAbs().maxCoeff(),
              1e-8 * (1.0 + slope.cwiseAbs().maxCoeff()));
  }
}

TEST(Latent, AFileThatIsNoDecoderIsRefused) {
  const auto decoder = trained(40);
  Tensors tensors = latent_tensors(*decoder);
  EXPECT_EQ(latent_decoder(tensors, "a")->second, decoder->second);
  tensors.tensors.at("classes").values[3] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(message_of([&] { (void)latent_decoder(tensors, "a"); }),
              HasSubstr("a: number 3 of tensor 'classes' is no number"));
  tensors.tensors.erase("decoder.skip");
  EXPECT_THAT(message_of([&] { (void)latent_decoder(tensors, "a"); }),
              HasSubstr("a: tensor 'decoder.skip' is missing or has not 36 × 8"));
}

}  // namespace
}  // namespace matterfit::material
