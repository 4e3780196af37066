// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <functional>
#include <vector>

#include "material/neural/isotropic_principal.hpp"
#include "material/neural/pretrain.hpp"

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

}  // namespace

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
