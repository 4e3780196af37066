// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <functional>
#include <vector>

#include "material/neural/isotropic_principal.hpp"
#include "material/neural/pretrain.hpp"
#include "material/neural/published_law.hpp"

namespace matterfit::material {
namespace {

constexpr std::size_t kSamples = 4000;
constexpr double kSmallStress = 0.01;

/// Principal values by a law: stresses of strains without flow, and strains that the flow keeps.
struct PrincipalLaw {
  std::function<std::vector<Vec3d>(const std::vector<PrincipalSample>&)> stresses;
  std::function<std::vector<Vec3d>(const std::vector<PrincipalSample>&)> kept;
};

LawAccuracy compare(const PrincipalLaw& law, const Material& material, std::uint64_t seed) {
  LawAccuracy out;
  std::vector<PrincipalSample> uniaxial;
  uniaxial.reserve(LawAccuracy::kStretches.size());
  for (const double stretch : LawAccuracy::kStretches) {
    uniaxial.push_back(principal_sample(material, Vec3d(std::log(stretch), 0.0, 0.0)));
  }
  const std::vector<Vec3d> along = law.stresses(uniaxial);
  for (std::size_t i = 0; i < uniaxial.size(); ++i) {
    out.uniaxial[i] = along[i][0] / uniaxial[i].tau[0] - 1.0;
  }
  Random random(seed);
  const double small = kSmallStress * material.p_wave_modulus();
  const std::vector<PrincipalSample> elastic = elastic_samples(material, kSamples, random);
  const std::vector<Vec3d> stresses = law.stresses(elastic);
  double sum = 0.0;
  for (std::size_t i = 0; i < elastic.size(); ++i) {
    sum +=
        (stresses[i] - elastic[i].tau).squaredNorm() / std::pow(elastic[i].tau.norm() + small, 2);
  }
  out.stress = std::sqrt(sum / kSamples);
  const std::vector<PrincipalSample> flows = flow_samples(material, kSamples, random);
  const std::vector<Vec3d> kept = law.kept(flows);
  sum = 0.0;
  double steps = 0.0;
  for (std::size_t i = 0; i < flows.size(); ++i) {
    sum += (kept[i] - flows[i].kept).squaredNorm();
    steps += (flows[i].trial - flows[i].kept).squaredNorm();
  }
  out.flow = std::sqrt(sum / kSamples);
  out.flow_step = std::sqrt(steps / kSamples);
  return out;
}

/// Diagonals of what the published law gives for diagonal deformations.
std::vector<Vec3d> published(const PublishedWeights& weights,
                             const std::vector<PrincipalSample>& samples, bool stress,
                             Arena& arena) {
  std::vector<double> trial(9 * samples.size(), 0.0);
  for (std::size_t p = 0; p < samples.size(); ++p)
    for (std::size_t i = 0; i < 3; ++i) {
      trial[9 * p + 4 * i] = std::exp(samples[p].trial[static_cast<Eigen::Index>(i)]);
    }
  std::vector<double> elastic(trial.size());
  std::vector<double> tau(trial.size());
  PublishedWeights used = weights;
  if (stress) used.plastic.assign(kNetWeights, 0.0F);
  published_forward<double>(used, GeluMode::kExact, trial, elastic, tau, arena);
  std::vector<Vec3d> out(samples.size());
  for (std::size_t p = 0; p < samples.size(); ++p)
    for (std::size_t i = 0; i < 3; ++i) {
      out[p][static_cast<Eigen::Index>(i)] =
          stress ? tau[9 * p + 4 * i] : std::log(elastic[9 * p + 4 * i]);
    }
  return out;
}

}  // namespace

LawAccuracy accuracy(const PublishedWeights& weights, const Material& material, std::uint64_t seed,
                     Arena& arena) {
  return compare({[&](const auto& samples) { return published(weights, samples, true, arena); },
                  [&](const auto& samples) { return published(weights, samples, false, arena); }},
                 material, seed);
}

LawAccuracy accuracy(const IsotropicWeights& weights, const Material& material, std::uint64_t seed,
                     Arena& arena) {
  const auto each = [&](const std::vector<PrincipalSample>& samples, const auto& one) {
    std::vector<Vec3d> out(samples.size());
    arena.parallel_for(0, samples.size(), 64,
                       [&](std::size_t i) { out[i] = one(samples[i].trial); });
    return out;
  };
  return compare({[&](const auto& samples) {
                    return each(samples, [&](const Vec3d& strain) {
                      return principal_response(weights, strain).tau;
                    });
                  },
                  [&](const auto& samples) {
                    return each(samples, [&](const Vec3d& strain) {
                      double plastic = 0.0;
                      return principal_flow(weights, strain, kSampleStep, plastic);
                    });
                  }},
                 material, seed);
}

}  // namespace matterfit::material
