// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/start_laws.hpp"

#include <cmath>
#include <string>

#include "base/error.hpp"
#include "material/classical/point_law.hpp"

namespace matterfit::material {
namespace {

constexpr std::array<std::string_view, 4> kNames{"jelly", "plasticine", "sand", "water"};

constexpr double kLargestStrain = 0.7;
constexpr double kLeastStartVolume = 0.55;
/// Largest strain that one substep adds.
constexpr double kLargestStep = 0.02;

Vec3d direction(Random& random) {
  // In the ball, then on the sphere.
  for (;;) {
    const Vec3d v(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(-1.0, 1.0));
    const double square = v.squaredNorm();
    if (square > 1e-4 && square < 1.0) return v / std::sqrt(square);
  }
}

Vec3d random_strain(Random& random) {
  for (;;) {
    Vec3d strain = direction(random) * (kLargestStrain * std::pow(random.uniform(), 1.5));
    if (std::exp(strain.sum()) >= kLeastStartVolume) return strain;
  }
}

/// Elasticity alone. A sample is one step from rest, so that what resists a rate has no place in
/// it.
Material without_flow(Material material) {
  if (material.traits().plastic) material.law = Law::kStvkHencky;
  material.viscosity = material.damping_shear = material.damping_bulk = 0.0;
  material.maxwell.clear();
  return material;
}

/// A law at one principal strain.
Vec3d advance(const PointLaw& law, const Vec3d& trial, Vec3d& kept) {
  PointState state;
  const Mat3d f = Vec3d(trial.array().exp()).asDiagonal();
  const Mat3d tau = law.advance(f, state);
  kept = state.elastic.diagonal().array().log();
  return tau.diagonal();
}

class Sampler {
 public:
  Sampler(const Material& material, double dt)
      : elastic_(without_flow(material), dt),
        flowing_(material, dt),
        relaxing_(material.traits().fluid ? rest_moduli(material).shear : 0.0) {}
  [[nodiscard]] PrincipalSample operator()(const Vec3d& trial) const {
    PrincipalSample sample;
    sample.trial = trial;
    sample.tau = advance(elastic_, trial, sample.kept);
    (void)advance(flowing_, trial, sample.kept);
    sample.tau.array() += 2.0 * relaxing_ * (trial.array() - trial.mean());
    return sample;
  }

 private:
  PointLaw elastic_;
  PointLaw flowing_;
  double relaxing_;  ///< shear modulus of what relaxes [Pa]
};

}  // namespace

std::string_view start_law_name(StartLaw law) { return kNames[static_cast<std::size_t>(law)]; }

StartLaw start_law_from_name(std::string_view name) {
  for (const StartLaw law : kStartLaws) {
    if (start_law_name(law) == name) return law;
  }
  throw_input("start law '" + std::string(name) +
              "' is not known. Use jelly, plasticine, sand or water.");
}

Material start_material(StartLaw law) {
  Material m;
  switch (law) {
    case StartLaw::kJelly:
      m.law = Law::kFixedCorotated;
      m.youngs_modulus = 1e5;
      m.poisson_ratio = 0.2;
      break;
    case StartLaw::kPlasticine:
      m.law = Law::kVonMises;
      m.youngs_modulus = 3e5;
      m.poisson_ratio = 0.25;
      // |dev ε| ≤ 5e3/(2μ) there, |2μ dev ε| ≤ √(2/3) τ_Y here.
      m.yield_stress = 5e3 * std::sqrt(1.5);
      break;
    case StartLaw::kSand:
      m.law = Law::kDruckerPrager;
      m.youngs_modulus = 1e6;
      m.poisson_ratio = 0.2;
      m.friction_angle = 25.0;
      break;
    case StartLaw::kWater: {
      m.law = Law::kNewtonian;
      Material solid;
      solid.youngs_modulus = 1e5;
      solid.poisson_ratio = 0.3;
      m.bulk_modulus = solid.lambda() + solid.mu() * 2.0 / 3.0;
      break;
    }
  }
  return m;
}

RestModuli rest_moduli(const Material& material) {
  if (!material.traits().fluid) {
    return {material.mu(), material.lambda() + material.mu() * 2.0 / 3.0};
  }
  constexpr double kRelaxed = 1e-3;  // [s]
  constexpr double kLeast = 1e-3;    // of the bulk modulus
  return {std::max(material.viscosity / kRelaxed, kLeast * material.bulk_modulus),
          material.bulk_modulus};
}

PrincipalSample principal_sample(const Material& material, const Vec3d& trial, double dt) {
  return Sampler(material, dt)(trial);
}

std::vector<PrincipalSample> elastic_samples(const Material& material, std::size_t count,
                                             Random& random) {
  const Sampler sampler(material, kSampleStep);
  std::vector<PrincipalSample> samples;
  samples.reserve(count);
  for (std::size_t i = 0; i < count; ++i) samples.push_back(sampler(random_strain(random)));
  return samples;
}

std::vector<PrincipalSample> flow_samples(const Material& material, std::size_t count,
                                          Random& random) {
  const Sampler sampler(material, kSampleStep);
  std::vector<PrincipalSample> samples;
  samples.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d kept = sampler(random_strain(random)).kept;
    const double u = random.uniform();
    samples.push_back(sampler(kept + direction(random) * (kLargestStep * u * u)));
  }
  return samples;
}

}  // namespace matterfit::material
