// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.hpp"
#include "base/parallel.hpp"
#include "material/neural/isotropic_principal.hpp"
#include "material/neural/latent.hpp"
#include "material/neural/latent_network.hpp"
#include "material/neural/start_laws.hpp"

namespace matterfit::material {
namespace {

/// Stresses below this share of the stiffest modulus count as this.
constexpr double kSmallStress = 0.003;
/// Weight of the pull of the network's weights to zero beside the mean squared relative error.
constexpr double kPrior = 1e-7;
/// Poisson's ratios of the solids sampled.
constexpr double kLeastPoisson = 0.0;
constexpr double kMostPoisson = 0.495;

constexpr auto kUnknowns = static_cast<Eigen::Index>(kLatentWeights);
constexpr auto kOutputs = static_cast<Eigen::Index>(kIsotropicElastic);

/// One classical law: its latents, and states with their stresses.
struct Lesson {
  Latent latent;
  double modulus;
  std::vector<PrincipalSample> samples;
};

std::vector<Lesson> lessons(const LatentPretraining& options) {
  constexpr std::array kLaws{Law::kFixedCorotated, Law::kNeoHookean, Law::kStvkHencky,
                             Law::kNewtonian};
  Random random(options.seed);
  std::vector<Lesson> all;
  all.reserve(options.materials);
  for (std::size_t i = 0; i < options.materials; ++i) {
    Material m;
    m.law = kLaws[i % kLaws.size()];
    m.youngs_modulus = 1.0;
    m.bulk_modulus = 1.0;
    // Evenly in the logarithm of 1 − 2ν: what κ/μ follows.
    m.poisson_ratio =
        0.5 - 0.5 * random.log_between(1.0 - 2.0 * kMostPoisson, 1.0 - 2.0 * kLeastPoisson);
    // Of a fluid κ/μ = 1 to 1000 comes from its viscosity.
    m.viscosity = 1e-3 * random.log_between(1e-3, 1.0);
    Lesson lesson{latent_of(m), m.p_wave_modulus(), elastic_samples(m, options.states, random)};
    all.push_back(std::move(lesson));
  }
  return all;
}

struct Normal {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(kUnknowns, kUnknowns);
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(kUnknowns);
  double cost = 0.0;
};

/// Cost, and with `full` the Gauss–Newton equations, of one lesson.
void add_lesson(const LatentNetwork& network, const Lesson& lesson, double share, bool full,
                Normal& sum) {
  const IsotropicWeights weights = latent_weights(network, lesson.latent);
  Eigen::Matrix<double, kOutputs, kOutputs> inner;
  Eigen::Matrix<double, kOutputs, 1> slope;
  inner.setZero();
  slope.setZero();
  for (const PrincipalSample& sample : lesson.samples) {
    const PrincipalResponse response = principal_response(weights, sample.trial);
    const Vec3d error = response.tau - sample.tau;
    const double scale = share / std::pow(sample.tau.norm() + kSmallStress * lesson.modulus, 2);
    sum.cost += scale * error.squaredNorm();
    if (!full) continue;
    inner += scale * response.by_weights.transpose() * response.by_weights;
    slope += scale * response.by_weights.transpose() * error;
  }
  if (!full) return;
  const LatentJacobian j =
      latent_jacobian(network, lesson.latent[kLatentVolume], lesson.latent[kLatentCurve]);
  sum.slope.noalias() += j.transpose() * slope;
  // Jᵀ inner J below its diagonal: J's columns of an output's own weights have that output's row
  // alone, and the same entries for each output.
  constexpr auto kFirst = static_cast<Eigen::Index>(3 * kLatentHidden);
  constexpr auto kRow = static_cast<Eigen::Index>(kLatentHidden + 3);
  const Eigen::Matrix<double, kOutputs, kFirst> hidden = j.leftCols<kFirst>();
  const Eigen::Matrix<double, kOutputs, kFirst> half = inner * hidden;
  sum.matrix.topLeftCorner<kFirst, kFirst>().noalias() += hidden.transpose() * half;
  const Eigen::Matrix<double, kRow, 1> activations = j.row(0).segment<kRow>(kFirst).transpose();
  const Eigen::Matrix<double, kRow, kRow> square = activations * activations.transpose();
  for (Eigen::Index k = 0; k < kOutputs; ++k) {
    sum.matrix.block<kRow, kFirst>(kFirst + k * kRow, 0) += activations * half.row(k);
    for (Eigen::Index l = 0; l <= k; ++l) {
      sum.matrix.block<kRow, kRow>(kFirst + k * kRow, kFirst + l * kRow) += inner(k, l) * square;
    }
  }
}

Normal equations(const LatentNetwork& network, const std::vector<Lesson>& all, bool full) {
  Normal sum;
  std::size_t states = 0;
  for (const Lesson& lesson : all) states += lesson.samples.size();
  const double share = 1.0 / static_cast<double>(states);
  for (const Lesson& lesson : all) add_lesson(network, lesson, share, full, sum);
  const Eigen::Map<const Eigen::VectorXd> w(network.data(), kUnknowns);
  sum.cost += kPrior * w.squaredNorm();
  sum.matrix.diagonal().array() += kPrior;
  sum.slope += kPrior * w;
  return sum;
}

LatentNetwork random_network(Random& random) {
  LatentNetwork network(kLatentWeights, 0.0);
  for (std::size_t i = 0; i < 3 * kLatentHidden; ++i) network[i] = random.between(-1.2, 1.2);
  // Outputs begin at those of a law of Hencky's with learning units.
  const IsotropicWeights plain = plain_isotropic(1.0, 1.0);
  for (std::size_t k = 0; k < kIsotropicElastic; ++k) {
    double* w = network.data() + 3 * kLatentHidden + k * (kLatentHidden + 3);
    w[0] = plain[k];
    for (std::size_t i = 0; i < kLatentHidden; ++i) w[3 + i] = random.between(-0.05, 0.05);
    if (k == 1) {
      // ln κ/μ is the first input itself.
      w[0] = 3.0;
      w[1] = 3.5;
    }
  }
  return network;
}

}  // namespace

LatentNetwork pretrain_latent(const LatentPretraining& options) {
  const std::vector<Lesson> all = lessons(options);
  Random random(options.seed + 1);
  LatentNetwork network = random_network(random);
  Normal at = equations(network, all, true);
  const double first = at.cost;
  double damping = 1e-2;
  for (int step = 0; step < options.most_steps && damping < 1e8; ++step) {
    Eigen::MatrixXd damped = at.matrix;
    damped.diagonal() += damping * (at.matrix.diagonal().array() + 1e-8).matrix();
    const Eigen::VectorXd move = damped.ldlt().solve(at.slope);
    LatentNetwork trial = network;
    for (std::size_t i = 0; i < trial.size(); ++i) {
      trial[i] -= std::clamp(move[static_cast<Eigen::Index>(i)], -1.0, 1.0);
    }
    const double cost = equations(trial, all, false).cost;
    if (std::isfinite(cost) && cost < at.cost) {
      network = std::move(trial);
      const bool settled = cost > at.cost * (1.0 - 1e-5);
      at = equations(network, all, true);
      damping = std::max(damping * 0.3, 1e-9);
      if (settled) break;
    } else {
      damping *= 4.0;
    }
  }
  if (!(at.cost < first)) {
    throw_compute("pretrain_latent: the regression does not improve on its start.");
  }
  return network;
}

}  // namespace matterfit::material
