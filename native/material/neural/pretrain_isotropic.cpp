// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "base/error.hpp"
#include "material/classical/law_constants.hpp"
#include "material/neural/isotropic_principal.hpp"
#include "material/neural/pretrain.hpp"

namespace matterfit::material {
namespace {

/// Stresses below this share of the stiffest modulus count as this.
constexpr double kSmallTrainingStress = 0.003;
constexpr int kMostSteps = 300;
/// Standard deviation of the prior about the start, in the weights' own units: keeps units that the
/// law does not need from drifting.
constexpr double kPriorWidth = 30.0;

/// Width of the prior of the gains' logarithms: no unit is to fall silent.
constexpr double kGainPriorWidth = 10.0;

/// A law whose units share the stiffness with μ and κ, each in its own range of strains: the bumps
/// sech² of their tangents overlap to a plateau. What a fit makes of their gains is then stiffening
/// or softening at those strains.
IsotropicWeights shared_stiffness(double shear, double bulk) {
  IsotropicWeights w = plain_isotropic(0.5 * shear, 0.5 * bulk);
  for (std::size_t k = 0; k < kShapeUnits; ++k) {
    w[kShapeGainWeight + k] = std::log(0.15);
    w[kShapeOwnWeight + k] = 4.0;
    w[kShapeTraceWeight + k] = -0.8;
    w[kShapeOffsetWeight + k] =
        1.2 * (2.0 * static_cast<double>(k) / (kShapeUnits - 1) - 1.0) * 1.5;
  }
  for (std::size_t k = 0; k < kVolumeUnits; ++k) {
    w[kVolumeGainWeight + k] = std::log(0.06 * bulk / shear);
    w[kVolumeTraceWeight + k] = 4.0;
    w[kVolumeOffsetWeight + k] =
        1.2 * (2.0 * static_cast<double>(k) / (kVolumeUnits - 1) - 1.0) * 1.5;
  }
  return w;
}

struct Regression {
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd residual;
};

constexpr Eigen::Index kUnknowns = static_cast<Eigen::Index>(kIsotropicElastic);

/// (τ − τ*) / size by the energy's weights, and the pull of the prior.
Regression linearise(const IsotropicWeights& weights, const IsotropicWeights& start,
                     const std::vector<PrincipalSample>& samples, double modulus) {
  const auto rows = static_cast<Eigen::Index>(3 * samples.size());
  Regression out{Eigen::MatrixXd::Zero(rows + kUnknowns, kUnknowns),
                 Eigen::VectorXd::Zero(rows + kUnknowns)};
  const double balance = 1.0 / std::sqrt(static_cast<double>(samples.size()));
  Eigen::Index row = 0;
  for (const PrincipalSample& sample : samples) {
    const PrincipalResponse response = principal_response(weights, sample.trial);
    const double scale = balance / (sample.tau.norm() + kSmallTrainingStress * modulus);
    for (int i = 0; i < 3; ++i, ++row) {
      out.residual[row] = scale * (response.tau[i] - sample.tau[i]);
      out.jacobian.row(row) = scale * response.by_weights.row(i);
    }
  }
  for (Eigen::Index k = 0; k < kUnknowns; ++k, ++row) {
    const auto at = static_cast<std::size_t>(k);
    const double pull = 1e-2 / (is_gain_weight(at) ? kGainPriorWidth : kPriorWidth);
    out.jacobian(row, k) = pull;
    out.residual[row] = pull * (weights[at] - start[at]);
  }
  return out;
}

}  // namespace

void set_classical_flow(const Material& material, double shear, IsotropicWeights& weights) {
  const auto c = law_constants<double>(material);
  const auto set = [&](std::size_t index, double value) {
    weights[index] = std::log(std::max(value, 1e-6));
  };
  constexpr double kNever = 1e3;
  constexpr double kAtOnce = 1e9;
  set(kYieldWeight, kNever);
  set(kFrictionWeight, 0.0);
  set(kHardeningWeight, 0.0);
  set(kTensionWeight, kNever);
  set(kRateWeight, kAtOnce);
  set(kThinningWeight, 0.0);
  switch (material.law) {
    case Law::kVonMises:
      set(kYieldWeight, c.yield / (2.0 * shear));
      // |s| ≤ √(2/3) (τ_Y + h p)
      set(kHardeningWeight, std::sqrt(2.0 / 3.0) * c.hardening / (2.0 * shear));
      break;
    case Law::kHerschelBulkley:
      set(kYieldWeight, c.yield / (2.0 * shear));
      if (c.eta > 0.0) set(kRateWeight, 2.0 * shear / c.eta);
      break;
    case Law::kDruckerPrager: {
      const double ratio = (3.0 * c.lambda + 2.0 * c.mu) / (2.0 * c.mu);
      set(kYieldWeight, 3.0 * ratio * c.alpha_tip);
      set(kFrictionWeight, ratio * c.alpha);
      set(kTensionWeight, 3.0 * c.tip);
      break;
    }
    case Law::kNewtonian:
      set(kYieldWeight, 0.0);
      if (c.eta > 0.0) set(kRateWeight, shear / c.eta);
      break;
    case Law::kFixedCorotated:
    case Law::kNeoHookean:
    case Law::kStvkHencky:
    case Law::kNeuralIsotropic:
    case Law::kLatent:
    case Law::kPublished:
      break;  // never flows
  }
}

IsotropicWeights pretrain_isotropic(const Material& material, const Pretraining& options) {
  Random random(options.seed);
  const std::vector<PrincipalSample> samples =
      elastic_samples(material, options.fit_samples, random);
  const RestModuli moduli = rest_moduli(material);
  const IsotropicWeights start = shared_stiffness(moduli.shear, moduli.bulk);
  const double modulus = material.p_wave_modulus();
  IsotropicWeights weights = start;
  Regression at = linearise(weights, start, samples, modulus);
  double damping = 1e-3;
  const double first = at.residual.squaredNorm();
  for (int step = 0; step < kMostSteps && damping < 1e8; ++step) {
    const Eigen::MatrixXd normal = at.jacobian.transpose() * at.jacobian;
    const Eigen::VectorXd slope = at.jacobian.transpose() * at.residual;
    Eigen::MatrixXd damped = normal;
    damped.diagonal() += damping * (normal.diagonal().array() + 1e-9).matrix();
    const Eigen::VectorXd move = damped.ldlt().solve(slope);
    IsotropicWeights trial = weights;
    for (std::size_t k = 0; k < kIsotropicElastic; ++k) {
      trial[k] -= std::clamp(move[static_cast<Eigen::Index>(k)], -1.0, 1.0);
    }
    Regression there = linearise(trial, start, samples, modulus);
    const double before = at.residual.squaredNorm();
    if (there.residual.allFinite() && there.residual.squaredNorm() < before) {
      const bool settled = there.residual.squaredNorm() > before * (1.0 - 1e-6);
      weights = trial;
      at = std::move(there);
      damping = std::max(damping * 0.3, 1e-9);
      if (settled) break;
    } else {
      damping *= 4.0;
    }
  }
  if (!(at.residual.squaredNorm() <= first)) {
    throw_compute("pretrain_isotropic: the regression does not improve on its start.");
  }
  set_classical_flow(material, rest_shear_modulus(weights), weights);
  return weights;
}

}  // namespace matterfit::material
