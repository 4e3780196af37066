// SPDX-License-Identifier: GPL-3.0-or-later
// What the isotropic neural law promises for any weights: objective, isotropic, symmetric,
// stress-free at rest, derived from a convex energy, dissipating; and its adjoint.
#include "material/neural/isotropic_law.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/vec.hpp"

namespace matterfit::material {
namespace {

using Row = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr double kDt = 1e-3;

/// Weights without any meaning, in each unit different.
IsotropicWeights random_weights(std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  IsotropicWeights w = plain_isotropic(4e4, 9e4);
  for (std::size_t i = 2; i < kIsotropicElastic; ++i) w[i] += 0.5 * uniform(random);
  for (std::size_t k = 0; k < kShapeUnits; ++k) w[2 + k] = uniform(random) - 1.0;
  for (std::size_t k = 0; k < kVolumeUnits; ++k) w[2 + 4 * kShapeUnits + k] = uniform(random) - 1.0;
  return w;
}

/// Yields, with a rate, friction and hardening, and tears.
IsotropicWeights flowing_weights(std::uint32_t seed) {
  IsotropicWeights w = random_weights(seed);
  w[kYieldWeight] = std::log(0.05);
  w[kFrictionWeight] = std::log(0.3);
  w[kHardeningWeight] = std::log(0.4);
  w[kTensionWeight] = std::log(0.1);
  w[kRateWeight] = std::log(500.0);
  w[kThinningWeight] = std::log(3000.0);
  return w;
}

double rest_bulk_modulus(const IsotropicWeights& weights) {
  const RestStiffness rest = rest_stiffness(isotropic_constants<double>(weights));
  return rest.bulk_by_shape + rest.bulk_by_volume;
}

struct Result {
  Mat3d elastic;
  Mat3d tau;
  double strain = 0.0;
};

Mat3d symmetric(const double* s) {
  Mat3d m;
  m << s[0], s[5], s[4], s[5], s[1], s[3], s[4], s[3], s[2];
  return m;
}

Result run(const IsotropicWeights& w, const Mat3d& f, double strain = 0.0, double dt = kDt) {
  Arena arena(1);
  const Row trial = f;
  Row elastic;
  double after = 0.0;
  double tau[6];
  isotropic_forward<double>(w, dt, {{trial.data(), 9}, {&strain, 1}},
                            {{elastic.data(), 9}, {&after, 1}, tau}, arena);
  return {elastic, symmetric(tau), after};
}

Mat3d random_rotation(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Quatd(normal(random), normal(random), normal(random), normal(random))
      .normalized()
      .toRotationMatrix();
}

Mat3d random_deformation(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> uniform(-size, size);
  const Vec3d e(uniform(random), uniform(random), uniform(random));
  return random_rotation(random) * Vec3d(e.array().exp()).asDiagonal() * random_rotation(random);
}

/// ψ as the header states it.
double energy(const IsotropicWeights& w, const Vec3d& eps) {
  const auto c = isotropic_constants<double>(w);
  const auto unit = [](double z, double offset) {
    const double shift = std::atanh(offset);
    return std::log(std::cosh(z + shift)) - std::log(std::cosh(shift)) - z * offset;
  };
  const double theta = eps.sum();
  double psi =
      c.mu * (eps.array() - theta / 3.0).matrix().squaredNorm() + 0.5 * c.kappa * theta * theta;
  for (std::size_t k = 0; k < kShapeUnits; ++k)
    for (int i = 0; i < 3; ++i) {
      psi += c.shape_gain[k] *
             unit(c.shape_own[k] * eps[i] + c.shape_trace[k] * theta, c.shape_offset[k]);
    }
  for (std::size_t k = 0; k < kVolumeUnits; ++k) {
    psi += c.volume_gain[k] * unit(c.volume_trace[k] * theta, c.volume_offset[k]);
  }
  return psi;
}

TEST(IsotropicLaw, StressIsTheSlopeOfTheEnergy) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-0.6, 0.6);
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    const IsotropicWeights w = random_weights(seed);
    const Vec3d eps(uniform(random), uniform(random), uniform(random));
    const Mat3d r = random_rotation(random);
    const Mat3d f = r * Vec3d(eps.array().exp()).asDiagonal() * r.transpose();
    const Mat3d tau = r.transpose() * run(w, f).tau * r;
    for (int i = 0; i < 3; ++i) {
      const double step = 1e-4;
      const Vec3d along = step * Vec3d::Unit(i);
      const double slope = (8.0 * (energy(w, eps + along) - energy(w, eps - along)) -
                            (energy(w, eps + 2 * along) - energy(w, eps - 2 * along))) /
                           (12.0 * step);
      EXPECT_NEAR(tau(i, i), slope, 1e-7 * rest_bulk_modulus(w));
    }
  }
}

TEST(IsotropicLaw, EnergyIsConvexInTheStrainAndItsStiffnessBounded) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    const IsotropicWeights w = random_weights(seed % 10);
    const Vec3d a(uniform(random), uniform(random), uniform(random));
    const Vec3d b(uniform(random), uniform(random), uniform(random));
    const double middle = energy(w, 0.5 * (a + b));
    EXPECT_LT(middle, 0.5 * (energy(w, a) + energy(w, b)));
    const Vec3d along = 1e-3 * Vec3d::UnitX();
    const double bend = (energy(w, a + along) - 2.0 * energy(w, a) + energy(w, a - along)) / 1e-6;
    EXPECT_LT(bend, longest_wave_modulus(isotropic_constants<double>(w)));
  }
}

TEST(IsotropicLaw, ModuliAtRestAreThoseOfSmallStrains) {
  const IsotropicWeights w = random_weights(3);
  const double small = 1e-6;
  Mat3d shear = Mat3d::Identity();
  shear(0, 1) = small;
  EXPECT_NEAR(run(w, shear).tau(0, 1) / small, rest_shear_modulus(w), 1e-5 * rest_shear_modulus(w));
  const Mat3d swollen = (1.0 + small) * Mat3d::Identity();
  EXPECT_NEAR(run(w, swollen).tau(0, 0) / (3.0 * small), rest_bulk_modulus(w),
              1e-5 * rest_bulk_modulus(w));
}

TEST(IsotropicLaw, RestIsFreeOfStress) {
  std::mt19937 random(4);
  for (std::uint32_t seed = 0; seed < 10; ++seed) {
    EXPECT_EQ(run(flowing_weights(seed), Mat3d::Identity()).tau, Mat3d::Zero());
    EXPECT_LT(run(flowing_weights(seed), random_rotation(random)).tau.norm(), 1e-9);
  }
}

TEST(IsotropicLaw, ObjectiveIsotropicAndSymmetric) {
  std::mt19937 random(5);
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    const IsotropicWeights w = flowing_weights(seed);
    const Mat3d f = random_deformation(random, 0.4);
    const Mat3d q = random_rotation(random);
    const Result plain = run(w, f, 0.02);
    const Result turned_after = run(w, q * f, 0.02);
    const Result turned_before = run(w, f * q, 0.02);
    const double scale = plain.tau.norm() + 1.0;
    EXPECT_LT((turned_after.tau - q * plain.tau * q.transpose()).norm(), 1e-10 * scale);
    EXPECT_LT((turned_after.elastic - q * plain.elastic).norm(), 1e-11);
    EXPECT_LT((turned_before.tau - plain.tau).norm(), 1e-10 * scale);
    EXPECT_LT((turned_before.elastic - plain.elastic * q).norm(), 1e-11);
    // Coaxial with the left stretch: no net torque about its axes.
    const Mat3d b = plain.elastic * plain.elastic.transpose();
    EXPECT_LT((plain.tau * b - b * plain.tau).norm(), 1e-10 * scale);
  }
}

TEST(IsotropicLaw, FlowNeverGivesEnergy) {
  std::mt19937 random(6);
  const auto energy_of = [](const IsotropicWeights& w, const Mat3d& f) {
    const Eigen::SelfAdjointEigenSolver<Mat3d> eigen(f.transpose() * f);
    return energy(w, 0.5 * eigen.eigenvalues().array().log());
  };
  int flowed = 0;
  for (std::uint32_t seed = 0; seed < 300; ++seed) {
    const IsotropicWeights w = flowing_weights(seed);
    const Mat3d f = random_deformation(random, 0.5);
    const Result result = run(w, f, 0.01);
    const double before = energy_of(w, f);
    const double after = energy_of(w, result.elastic);
    EXPECT_LE(after, before * (1.0 + 1e-12));
    EXPECT_GE(result.strain, 0.01);
    if (result.strain > 0.01) ++flowed;
  }
  EXPECT_GT(flowed, 200);
}

TEST(IsotropicLaw, AClosedCycleTakesWork) {
  // ∮ τ : dF F⁻¹ around a loop in shear and stretch, of the elastic law zero, of the flowing one
  // positive.
  const auto work = [](const IsotropicWeights& w) {
    Mat3d elastic = Mat3d::Identity();
    Mat3d total = Mat3d::Identity();
    Mat3d tau_before = Mat3d::Zero();
    double strain = 0.0;
    double sum = 0.0;
    const int steps = 4000;
    for (int n = 1; n <= 2 * steps; ++n) {
      const double phase = 2.0 * M_PI * n / steps;
      Mat3d f = Mat3d::Identity();
      f(0, 1) = 0.2 * std::sin(phase);
      f(0, 0) = 1.0 + 0.1 * (1.0 - std::cos(phase));
      f(2, 2) = 1.0 - 0.05 * std::sin(2.0 * phase);
      const Mat3d step = f * total.inverse();
      const Result result = run(w, step * elastic, strain, 1e-3);
      const Mat3d increment = step - Mat3d::Identity();
      sum +=
          (0.5 * (result.tau + tau_before)).cwiseProduct(increment).sum() -
          0.25 * ((result.tau + tau_before) * increment).cwiseProduct(increment.transpose()).sum();
      elastic = result.elastic;
      strain = result.strain;
      tau_before = result.tau;
      total = f;
    }
    return sum;
  };
  const double scale = rest_shear_modulus(random_weights(7)) * 0.04;
  EXPECT_NEAR(work(random_weights(7)) / scale, 0.0, 1e-3);
  EXPECT_GT(work(flowing_weights(7)) / scale, 0.1);
}

TEST(IsotropicLaw, PlasticSolidAndFluidAreItsLimits) {
  IsotropicWeights w = plain_isotropic(4e4, 9e4);
  w[kYieldWeight] = std::log(0.01);
  Mat3d f = Mat3d::Identity();
  f(0, 1) = 0.2;
  // Von Mises: |dev τ| stays at 2μ times the yield strain.
  const Mat3d tau = run(w, f).tau;
  const double norm = (tau - tau.trace() / 3.0 * Mat3d::Identity()).norm();
  EXPECT_NEAR(norm, 2.0 * rest_shear_modulus(w) * 0.01, 0.01 * norm);
  // A Maxwell fluid in steady shear: viscosity μ/ρ.
  w[kYieldWeight] = std::log(1e-9);
  w[kRateWeight] = std::log(1e5);
  const double shear_rate = 200.0;
  const double dt = 1e-6;
  Mat3d step = Mat3d::Identity();
  step(0, 1) = shear_rate * dt;
  Result state;
  state.elastic = Mat3d::Identity();
  for (int n = 0; n < 400; ++n) state = run(w, step * state.elastic, 0.0, dt);
  const double viscosity = rest_shear_modulus(w) / 1e5;
  EXPECT_NEAR(state.tau(0, 1), viscosity * shear_rate, 0.2 * viscosity * shear_rate);
}

/// L = Σ F̄ : F + τ̄ : τ + s̄ s by the double evaluation.
struct Problem {
  IsotropicWeights weights;
  std::vector<double> trial;
  std::vector<double> strain;
  std::vector<double> elastic_bar;
  std::vector<double> tau_bar;
  std::vector<double> after_bar;

  Problem(const IsotropicWeights& w, std::size_t count, double size) : weights(w) {
    std::mt19937 random(8);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    trial.reserve(9 * count);
    for (std::size_t p = 0; p < count; ++p) {
      // Also near rest and with equal stretches.
      Row f = random_deformation(random, p % 4 == 1 ? 1e-3 * size : size);
      if (p % 4 == 2) f = random_rotation(random) * Vec3d(1.1, 1.1, 0.8).asDiagonal();
      trial.insert(trial.end(), f.data(), f.data() + 9);
      strain.push_back(0.02 + 0.01 * uniform(random));
      after_bar.push_back(1e4 * uniform(random));
      for (int i = 0; i < 9; ++i) elastic_bar.push_back(1e4 * uniform(random));
      for (int i = 0; i < 6; ++i) tau_bar.push_back(uniform(random));
    }
  }
  [[nodiscard]] std::size_t count() const { return strain.size(); }
  [[nodiscard]] std::vector<double> values(Arena& arena) const {
    std::vector<double> f(9 * count());
    std::vector<double> s(count());
    std::vector<double> t(6 * count());
    isotropic_forward<double>(weights, kDt, {trial, strain}, {f, s, t}, arena);
    std::vector<double> sums(count());
    for (std::size_t p = 0; p < count(); ++p) {
      sums[p] = after_bar[p] * s[p];
      for (std::size_t i = 0; i < 9; ++i) sums[p] += elastic_bar[9 * p + i] * f[9 * p + i];
      for (std::size_t i = 0; i < 6; ++i) {
        sums[p] += (i < 3 ? 1.0 : 2.0) * tau_bar[6 * p + i] * t[6 * p + i];
      }
    }
    return sums;
  }
  [[nodiscard]] double total(Arena& arena) const {
    double sum = 0.0;
    for (const double value : values(arena)) sum += value;
    return sum;
  }
};

template <class Value>
double fourth_order(double step, const Value& value) {
  return (8.0 * (value(step) - value(-step)) - (value(2 * step) - value(-2 * step))) /
         (12.0 * step);
}

double largest(const std::vector<double>& values) {
  double most = 0.0;
  for (const double value : values) most = std::max(most, std::abs(value));
  return most;
}

TEST(IsotropicLaw, GradientsAreThoseOfDifferences) {
  Arena arena(1);
  for (const bool flowing : {false, true}) {
    Problem problem(flowing ? flowing_weights(9) : random_weights(9), 40, 0.35);
    std::vector<double> trial_bar(problem.trial.size());
    std::vector<double> strain_bar(problem.count());
    IsotropicWeights weights_bar{};
    isotropic_backward<double>(problem.weights, kDt, {problem.trial, problem.strain},
                               {problem.elastic_bar, problem.after_bar, problem.tau_bar}, trial_bar,
                               strain_bar, weights_bar, arena);
    const double scale = largest(trial_bar);
    for (std::size_t i = 0; i < problem.trial.size(); ++i) {
      Problem moved = problem;
      const double slope = fourth_order(1e-5, [&](double by) {
        moved.trial[i] = problem.trial[i] + by;
        return moved.values(arena)[i / 9];
      });
      EXPECT_NEAR(trial_bar[i], slope, 1e-6 * scale) << "point " << i / 9 << " entry " << i % 9;
    }
    for (std::size_t p = 0; p < problem.count(); ++p) {
      Problem moved = problem;
      const double slope = fourth_order(1e-5, [&](double by) {
        moved.strain[p] = problem.strain[p] + by;
        return moved.values(arena)[p];
      });
      EXPECT_NEAR(strain_bar[p], slope, 1e-6 * largest(strain_bar)) << "point " << p;
    }
    for (std::size_t k = 0; k < kIsotropicWeights; ++k) {
      Problem moved = problem;
      const double slope = fourth_order(1e-4, [&](double by) {
        moved.weights[k] = problem.weights[k] + by;
        return moved.total(arena);
      });
      EXPECT_NEAR(weights_bar[k], slope, 1e-6 * (std::abs(slope) + 1e-3 * scale)) << "weight " << k;
    }
  }
}

TEST(IsotropicLaw, RegistersGiveWhatDoubleGivesForAnyNumberOfThreads) {
  const Problem problem(flowing_weights(10), 1111, 0.3);
  const auto narrow = [](const std::vector<double>& from) {
    std::vector<float> out;
    out.reserve(from.size());
    for (const double value : from) out.push_back(static_cast<float>(value));
    return out;
  };
  const std::vector<float> trial = narrow(problem.trial);
  const std::vector<float> strain = narrow(problem.strain);
  const std::vector<float> f_bar = narrow(problem.elastic_bar);
  const std::vector<float> t_bar = narrow(problem.tau_bar);
  const std::vector<float> s_bar = narrow(problem.after_bar);
  const std::size_t n = problem.count();
  struct Run {
    std::vector<float> elastic, after, tau, trial_bar, strain_bar;
    IsotropicWeights weights_bar{};
  };
  const auto run_on = [&](int threads) {
    Arena arena(threads);
    Run r;
    r.elastic.resize(9 * n);
    r.after.resize(n);
    r.tau.resize(6 * n);
    r.trial_bar.resize(9 * n);
    r.strain_bar.resize(n);
    isotropic_forward<float>(problem.weights, kDt, {trial, strain}, {r.elastic, r.after, r.tau},
                             arena);
    isotropic_backward<float>(problem.weights, kDt, {trial, strain}, {f_bar, s_bar, t_bar},
                              r.trial_bar, r.strain_bar, r.weights_bar, arena);
    return r;
  };
  const Run one = run_on(1);
  const Run three = run_on(3);
  EXPECT_EQ(one.tau, three.tau);
  EXPECT_EQ(one.trial_bar, three.trial_bar);
  EXPECT_EQ(one.weights_bar, three.weights_bar);

  Arena arena(1);
  std::vector<double> elastic(9 * n);
  std::vector<double> after(n);
  std::vector<double> tau(6 * n);
  isotropic_forward<double>(problem.weights, kDt, {problem.trial, problem.strain},
                            {elastic, after, tau}, arena);
  const double scale = largest(tau);
  for (std::size_t i = 0; i < tau.size(); ++i) EXPECT_NEAR(one.tau[i], tau[i], 1e-5 * scale);
  for (std::size_t i = 0; i < elastic.size(); ++i) EXPECT_NEAR(one.elastic[i], elastic[i], 5e-6);
  std::vector<double> trial_bar(9 * n);
  std::vector<double> strain_bar(n);
  IsotropicWeights weights_bar{};
  isotropic_backward<double>(problem.weights, kDt, {problem.trial, problem.strain},
                             {problem.elastic_bar, problem.after_bar, problem.tau_bar}, trial_bar,
                             strain_bar, weights_bar, arena);
  for (std::size_t k = 0; k < kIsotropicWeights; ++k) {
    EXPECT_NEAR(one.weights_bar[k], weights_bar[k], 1e-4 * (std::abs(weights_bar[k]) + scale));
  }
}

TEST(IsotropicLaw, WeightsGoThroughAFile) {
  const IsotropicWeights w = flowing_weights(11);
  const Tensors tensors = isotropic_tensors(w);
  const IsotropicWeights read = isotropic_weights(tensors, "file");
  for (std::size_t i = 0; i < kIsotropicWeights; ++i) EXPECT_NEAR(read[i], w[i], 1e-6 * 20.0);
  EXPECT_THROW((void)isotropic_weights(Tensors{}, "file"), Error);
}

}  // namespace
}  // namespace matterfit::material
