// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/pretrain_published.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "material/neural/net_regression.hpp"
#include "material/neural/published_law.hpp"

namespace matterfit::material {
namespace {

/// Principal states that a net is taught, each of them turned otherwise whenever it is drawn.
constexpr std::size_t kPrincipalStates = 30000;
constexpr std::size_t kFirst = kNetHidden * kNetFeatures;
constexpr std::size_t kSecond = kNetHidden * kNetHidden;

/// One principal state: the strain, X there, and how much its error counts.
struct NetState {
  Vec3d strain;
  Vec3d x;
  double weight;
};

double normal(Random& random) {
  return std::sqrt(-2.0 * std::log(1.0 - random.uniform())) *
         std::cos(2.0 * std::numbers::pi * random.uniform());
}

/// Evenly over all rotations.
Mat3d any_rotation(Random& random) {
  Quatd q(normal(random), normal(random), normal(random), normal(random));
  return q.normalized().toRotationMatrix();
}

Vec3d any_direction(Random& random) {
  return Vec3d(normal(random), normal(random), normal(random)).normalized();
}

/// Stresses without flow. A fluid keeps no shear, so that it is asked for little of it.
std::vector<PrincipalSample> stress_samples(const Material& material, std::size_t count,
                                            Random& random) {
  if (!material.traits().fluid) return elastic_samples(material, count, random);
  constexpr double kLargestShape = 0.06;
  constexpr double kLargestVolume = 0.5;
  std::vector<PrincipalSample> samples;
  for (std::size_t i = 0; i < count; ++i) {
    Vec3d strain = any_direction(random) * random.log_between(1e-3, kLargestShape);
    strain.array() -= strain.mean();
    const double size = kLargestVolume * std::pow(random.uniform(), 1.5);
    strain.array() += (random.uniform() < 0.5 ? -size : size) / 3.0;
    samples.push_back(principal_sample(material, strain, kPublishedSubstep));
  }
  return samples;
}

/// X = S⁻¹τ in units of `unit`, its error relative to its size.
std::vector<NetState> elastic_states(const Material& material, double unit, Random& random) {
  // A fluid's shear is small beside its pressure, and must not be lost.
  const double small = material.traits().fluid ? 0.002 : 0.005;
  std::vector<NetState> states;
  const auto add = [&](const PrincipalSample& s) {
    const Vec3d x = s.tau.array() / (unit * s.trial.array().exp());
    states.push_back({s.trial, x, 1.0 / (x.norm() + small)});
  };
  for (const PrincipalSample& s : stress_samples(material, kPrincipalStates, random)) add(s);
  // More that are small, for at rest is where a body spends its time, and that a testing machine
  // makes.
  for (std::size_t i = 0; i < kPrincipalStates / 2; ++i) {
    if (!material.traits().fluid) {
      const Vec3d strain = any_direction(random) * random.log_between(3e-3, 0.2);
      add(principal_sample(material, strain, kPublishedSubstep));
    }
    add(principal_sample(material, Vec3d(random.between(-0.45, 0.45), 0.0, 0.0),
                         kPublishedSubstep));
  }
  return states;
}

/// Trial strains within the yield surface, on it, a substep's step beyond, and far beyond.
std::vector<Vec3d> trial_strains(const Material& material, std::size_t count, Random& random) {
  constexpr double kLargestStep = 0.02;
  std::vector<Vec3d> trials;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d far = any_direction(random) * random.log_between(2e-3, 0.4);
    const Vec3d kept = principal_sample(material, far, kPublishedSubstep).kept;
    const double u = random.uniform();
    const Vec3d step = any_direction(random) * (kLargestStep * u * u);
    switch (i % 8) {
      case 0:
        trials.push_back(kept + 4.0 * step);
        break;
      case 1:
      case 2:
        trials.push_back(kept * random.uniform());
        break;
      case 3:
        trials.push_back(kept * random.uniform() + step);
        break;
      default:
        trials.push_back(kept + step);
    }
  }
  return trials;
}

/// X = (S_kept − S)/α in units of `unit`.
std::vector<NetState> plastic_states(const Material& material, double unit, Random& random) {
  /// Size of a step [strain].
  constexpr double kSmall = 1e-3;
  std::vector<NetState> states;
  for (const Vec3d& trial : trial_strains(material, kPrincipalStates, random)) {
    const Vec3d kept = principal_sample(material, trial, kPublishedSubstep).kept;
    const Vec3d step = kept.array().exp() - trial.array().exp();
    states.push_back({trial, step / (kPublishedFlowScale * unit),
                      kPublishedFlowScale * unit / (step.norm() + kSmall)});
  }
  return states;
}

/// Adam with a cosine. The first matrix is learned in units of `gain`, which is about one over the
/// strains that matter.
std::vector<float> regress(const std::vector<NetState>& states, double gain,
                           const PublishedPretraining& options, Random& random, Arena& arena) {
  constexpr double kRate = 1e-2;
  constexpr double kMean = 0.9;
  constexpr double kSquare = 0.99;
  std::vector<double> unit(kNetWeights, 1.0);
  std::vector<double> net(kNetWeights);
  for (std::size_t i = 0; i < kNetWeights; ++i) {
    const bool first = i < kFirst;
    if (first) unit[i] = gain;
    const bool last = i >= kFirst + kSecond;
    const double spread = std::sqrt((last ? 0.1 : 2.0) / double(first ? kNetFeatures : kNetHidden));
    net[i] = spread * normal(random);
  }
  std::vector<double> mean(kNetWeights, 0.0);
  std::vector<double> square(kNetWeights, 0.0);
  std::vector<double> gradient(kNetWeights);
  std::vector<float> now(kNetWeights);
  const auto set_now = [&] {
    for (std::size_t i = 0; i < kNetWeights; ++i) now[i] = float(net[i] * unit[i]);
  };
  NetSamples samples;
  double mean_power = 1.0;
  double square_power = 1.0;
  for (int step = 0; step < options.steps; ++step) {
    samples.clear();
    for (std::size_t i = 0; i < options.batch; ++i) {
      const NetState& s = states[random.next() % states.size()];
      samples.add(any_rotation(random), s.strain, s.x, s.weight);
    }
    set_now();
    (void)net_loss(now, samples, gradient, arena);
    mean_power *= kMean;
    square_power *= kSquare;
    const double share = double(step) / double(options.steps);
    const double warm = std::min(1.0, double(step + 1) / 50.0);
    const double rate = kRate * warm * 0.5 * (1.0 + std::cos(std::numbers::pi * share));
    for (std::size_t i = 0; i < kNetWeights; ++i) {
      const double g = gradient[i] * unit[i] / double(options.batch);
      mean[i] = kMean * mean[i] + (1.0 - kMean) * g;
      square[i] = kSquare * square[i] + (1.0 - kSquare) * g * g;
      net[i] -= rate * (mean[i] / (1.0 - mean_power)) /
                (std::sqrt(square[i] / (1.0 - square_power)) + 1e-10);
    }
  }
  set_now();
  return now;
}

/// The last matrix in other units.
void scale_output(std::vector<float>& net, double by) {
  for (std::size_t i = kFirst + kSecond; i < kNetWeights; ++i) net[i] *= float(by);
}

/// Strain at which the law begins to flow, about.
double flow_strain(const Material& material) {
  if (material.law == Law::kVonMises) return material.yield_stress / (2.0 * material.mu());
  return 0.05;
}

}  // namespace

PublishedWeights pretrain_published(const Material& material, const PublishedPretraining& options,
                                    Arena& arena) {
  Random random(options.seed);
  PublishedWeights weights;
  const double modulus = material.p_wave_modulus();
  weights.elastic = regress(elastic_states(material, modulus, random), 4.0, options, random, arena);
  scale_output(weights.elastic, modulus);
  const bool flows = material.traits().plastic || material.traits().fluid;
  constexpr double kFlowUnit = 10.0;
  PublishedPretraining plastic = options;
  if (!flows) plastic.steps = 0;
  const std::vector<NetState> states =
      flows ? plastic_states(material, kFlowUnit, random) : std::vector<NetState>(1);
  weights.plastic = regress(states, 1.0 / flow_strain(material), plastic, random, arena);
  // Without flow the first two matrices are there for a fit to begin with.
  scale_output(weights.plastic, flows ? kFlowUnit : 0.0);
  return weights;
}

namespace {

/// The law at symmetric stretches, as the solver has it: F after the flow and τ.
struct Evaluated {
  std::vector<double> trial;
  std::vector<double> elastic;
  std::vector<double> tau;

  void add(const Mat3d& s) {
    for (int k = 0; k < 9; ++k) trial.push_back(s(k / 3, k % 3));
  }
  void run(const PublishedWeights& weights, Arena& arena) {
    elastic.resize(trial.size());
    tau.resize(trial.size());
    published_forward<double>(weights, GeluMode::kPolynomial, trial, elastic, tau, arena);
  }
  static Mat3d at(const std::vector<double>& of, std::size_t i) {
    Mat3d m;
    for (int k = 0; k < 9; ++k) m(k / 3, k % 3) = of[9 * i + std::size_t(k)];
    return m;
  }
};

Mat3d turned(const Mat3d& q, const Vec3d& values) {
  return q * values.asDiagonal() * q.transpose();
}

}  // namespace

PublishedAccuracy published_accuracy(const PublishedWeights& weights, const Material& material,
                                     std::uint64_t seed, Arena& arena) {
  constexpr std::size_t kDirections = 64;
  constexpr std::size_t kStates = 4000;
  constexpr double kSmallStress = 0.01;
  PublishedAccuracy out;
  Random random(seed);
  PublishedWeights elastic = weights;
  elastic.plastic.assign(kNetWeights, 0.0F);

  for (std::size_t s = 0; s < PublishedAccuracy::kStretches.size(); ++s) {
    const Vec3d strain(std::log(PublishedAccuracy::kStretches[s]), 0.0, 0.0);
    const double expected = principal_sample(material, strain, kPublishedSubstep).tau[0];
    Evaluated law;
    std::vector<Vec3d> axes;
    for (std::size_t i = 0; i < kDirections; ++i) {
      const Mat3d q = any_rotation(random);
      axes.emplace_back(q.col(0));
      law.add(turned(q, strain.array().exp()));
    }
    law.run(elastic, arena);
    for (std::size_t i = 0; i < kDirections; ++i) {
      const double error = axes[i].dot(Evaluated::at(law.tau, i) * axes[i]) / expected - 1.0;
      out.uniaxial[s] += error / double(kDirections);
      if (std::abs(error) > std::abs(out.uniaxial_worst[s])) out.uniaxial_worst[s] = error;
    }
  }

  const double small = kSmallStress * material.p_wave_modulus();
  Evaluated law;
  std::vector<Mat3d> expected;
  for (const PrincipalSample& s : stress_samples(material, kStates, random)) {
    const Mat3d q = any_rotation(random);
    law.add(turned(q, s.trial.array().exp()));
    expected.push_back(turned(q, s.tau));
  }
  law.run(elastic, arena);
  double sum = 0.0;
  for (std::size_t i = 0; i < kStates; ++i) {
    const double error = (Evaluated::at(law.tau, i) - expected[i]).norm();
    sum += std::pow(error / (expected[i].norm() + small), 2);
  }
  out.stress = std::sqrt(sum / double(kStates));

  Evaluated flows;
  std::vector<Mat3d> kept;
  for (const Vec3d& trial : trial_strains(material, kStates, random)) {
    const Mat3d q = any_rotation(random);
    flows.add(turned(q, trial.array().exp()));
    const Vec3d after = principal_sample(material, trial, kPublishedSubstep).kept;
    kept.push_back(turned(q, after.array().exp()));
  }
  flows.run(weights, arena);
  double errors = 0.0;
  double steps = 0.0;
  double crept = 0.0;
  std::size_t still = 0;
  for (std::size_t i = 0; i < kStates; ++i) {
    const double step = (Evaluated::at(flows.trial, i) - kept[i]).squaredNorm();
    const double error = (Evaluated::at(flows.elastic, i) - kept[i]).squaredNorm();
    errors += error;
    steps += step;
    if (step > 1e-16) continue;
    crept += error;
    ++still;
  }
  out.flow = std::sqrt(errors / double(kStates));
  out.flow_step = std::sqrt(steps / double(kStates));
  out.creep = still > 0 ? std::sqrt(crept / double(still)) : 0.0;
  return out;
}

}  // namespace matterfit::material
