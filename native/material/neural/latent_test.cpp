// SPDX-License-Identifier: GPL-3.0-or-later
// The latent law: classical laws as places in one space, gradients by the latents, and finding an
// unknown law's latents from stresses alone.
#include "material/neural/latent.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <sstream>
#include <string>

#include "base/error.hpp"
#include "material/neural/isotropic_principal.hpp"
#include "material/neural/pretrain.hpp"

namespace matterfit::material {
namespace {

const LatentNetwork& network() {
  static const LatentNetwork kNetwork = [] {
    LatentPretraining options;
    options.materials = 96;
    options.states = 24;
    options.most_steps = 80;
    return pretrain_latent(options);
  }();
  return kNetwork;
}

Material solid(Law law, double youngs_modulus, double poisson_ratio) {
  Material m;
  m.law = law;
  m.youngs_modulus = youngs_modulus;
  m.poisson_ratio = poisson_ratio;
  return m;
}

TEST(Latent, EveryStartLawIsAPlace) {
  Arena arena(2);
  for (const StartLaw law : kStartLaws) {
    const Material material = start_material(law);
    const LawAccuracy a =
        accuracy(latent_weights(network(), latent_of(material)), material, 9, arena);
    std::ostringstream line;
    line << "uniaxial";
    for (const double error : a.uniaxial) line << ' ' << error;
    line << ", stress " << a.stress << ", flow " << a.flow << " of steps " << a.flow_step;
    RecordProperty(std::string(start_law_name(law)), line.str());
    for (const double error : a.uniaxial) EXPECT_LT(std::abs(error), 0.05) << start_law_name(law);
    EXPECT_LT(a.flow, 0.05 * a.flow_step + 1e-4) << start_law_name(law);
  }
}

TEST(Latent, MaterialsNotSeenInTraining) {
  Arena arena(2);
  for (const Law law : {Law::kFixedCorotated, Law::kNeoHookean, Law::kStvkHencky}) {
    for (const double poisson : {0.05, 0.22, 0.37, 0.44}) {
      const Material m = solid(law, 3.3e4, poisson);
      const LawAccuracy a = accuracy(latent_weights(network(), latent_of(m)), m, 9, arena);
      EXPECT_LT(std::abs(a.uniaxial[0]), 0.05) << traits(law).name << " " << poisson;
      EXPECT_LT(std::abs(a.uniaxial[2]), 0.06) << traits(law).name << " " << poisson;
      EXPECT_LT(a.stress, 0.2) << traits(law).name << " " << poisson;
    }
  }
}

TEST(Latent, GradientsAreThoseOfDifferences) {
  const Latent z = latent_of(start_material(StartLaw::kSand));
  IsotropicWeights bar{};
  for (std::size_t k = 0; k < kIsotropicWeights; ++k) {
    bar[k] = std::sin(1.0 + static_cast<double>(k));
  }
  Latent z_bar{};
  add_latent_adjoint(network(), z, bar, z_bar);
  for (std::size_t i = 0; i < kLatentNumbers; ++i) {
    const auto value = [&](double by) {
      Latent moved = z;
      moved[i] += by;
      const IsotropicWeights w = latent_weights(network(), moved);
      double sum = 0.0;
      for (std::size_t k = 0; k < kIsotropicWeights; ++k) sum += bar[k] * w[k];
      return sum;
    };
    const double h = 1e-4;
    const double slope = (8.0 * (value(h) - value(-h)) - (value(2 * h) - value(-2 * h))) / (12 * h);
    EXPECT_NEAR(z_bar[i], slope, 1e-8 * (1.0 + std::abs(slope))) << i;
  }
}

/// Gauss–Newton on latents [modulus, volume, curve, yield] from kept stresses of sampled strains.
TEST(Latent, UnknownLawIsFoundFromItsStresses) {
  const Material truth = [] {
    Material m = solid(Law::kVonMises, 2e5, 0.31);
    m.yield_stress = 9e3;
    return m;
  }();
  Random random(3);
  std::vector<PrincipalSample> samples = elastic_samples(truth, 60, random);
  const auto stresses = [&](const Latent& z) {
    const IsotropicWeights w = latent_weights(network(), z);
    Eigen::VectorXd out(static_cast<Eigen::Index>(3 * samples.size()));
    Eigen::Index row = 0;
    for (const PrincipalSample& s : samples) {
      double plastic = 0.0;
      const Vec3d kept = principal_flow(w, s.trial, 1e-4, plastic);
      out.segment<3>(row) = principal_response(w, kept).tau / 1e5;
      row += 3;
    }
    return out;
  };
  const Latent exact = latent_of(truth);
  const Eigen::VectorXd target = stresses(exact);
  // A jelly ten times softer that yields late.
  Latent z = latent_of(solid(Law::kFixedCorotated, 2e4, 0.2));
  z[kLatentYield] = std::log(0.3);
  const std::array<std::size_t, 4> free{kLatentModulus, kLatentVolume, kLatentCurve, kLatentYield};
  double damping = 1e-2;
  Eigen::VectorXd error = stresses(z) - target;
  for (int step = 0; step < 60; ++step) {
    Eigen::MatrixXd j(error.size(), 4);
    for (int k = 0; k < 4; ++k) {
      Latent up = z;
      up[free[static_cast<std::size_t>(k)]] += 1e-5;
      j.col(k) = (stresses(up) - target - error) / 1e-5;
    }
    Eigen::Matrix4d normal = j.transpose() * j;
    normal.diagonal() += damping * (normal.diagonal().array() + 1e-9).matrix();
    const Eigen::Vector4d move = normal.ldlt().solve(j.transpose() * error);
    Latent trial = z;
    for (int k = 0; k < 4; ++k) {
      const std::size_t i = free[static_cast<std::size_t>(k)];
      trial[i] = std::clamp(trial[i] - std::clamp(move[k], -1.0, 1.0), latent_ranges()[i].low,
                            latent_ranges()[i].high);
    }
    const Eigen::VectorXd there = stresses(trial) - target;
    if (there.squaredNorm() < error.squaredNorm()) {
      z = trial;
      error = there;
      damping *= 0.3;
    } else {
      damping *= 4.0;
    }
  }
  EXPECT_NEAR(z[kLatentModulus] + z[kLatentYield], exact[kLatentModulus] + exact[kLatentYield],
              0.02);
  EXPECT_NEAR(z[kLatentModulus] + z[kLatentVolume], exact[kLatentModulus] + exact[kLatentVolume],
              0.02);
}

TEST(Latent, NetworkGoesThroughAFile) {
  const LatentNetwork read = latent_network(latent_tensors(network()), "file");
  for (std::size_t i = 0; i < kLatentWeights; ++i) EXPECT_NEAR(read[i], network()[i], 1e-5);
  EXPECT_THROW((void)latent_network(Tensors{}, "file"), Error);
  EXPECT_THROW(check_latent_network(LatentNetwork(3, 0.0), "file"), Error);
}

}  // namespace
}  // namespace matterfit::material
