// SPDX-License-Identifier: GPL-3.0-or-later
// The yardstick is only worth its name if it computes the right thing.
#include "bench/serial_mpm.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace matterfit::bench {
namespace {

constexpr float kSeparation = 0.01F;
constexpr float kMass = 1e-3F;

std::vector<SerialMpm::Particle> cube(int edge, float low) {
  std::vector<SerialMpm::Particle> particles;
  for (int i = 0; i < edge; ++i) {
    for (int j = 0; j < edge; ++j) {
      for (int k = 0; k < edge; ++k) {
        SerialMpm::Particle p{};
        p.x = {low + (static_cast<float>(i) + 0.5F) * kSeparation,
               low + (static_cast<float>(j) + 0.5F) * kSeparation,
               low + (static_cast<float>(k) + 0.5F) * kSeparation};
        p.F = {1, 0, 0, 0, 1, 0, 0, 0, 1};
        p.mass = kMass;
        p.volume = kSeparation * kSeparation * kSeparation;
        particles.push_back(p);
      }
    }
  }
  return particles;
}

std::array<double, 3> mean_velocity(const std::vector<SerialMpm::Particle>& particles) {
  std::array<double, 3> mean{};
  for (const auto& p : particles) {
    for (std::size_t a = 0; a < 3; ++a) mean[a] += p.v[a] / static_cast<double>(particles.size());
  }
  return mean;
}

TEST(SerialMpmTest, FallsFreelyWithoutDeforming) {
  SerialMpm::Options options;
  options.grid = 40;
  SerialMpm mpm(cube(8, 0.3F), options);
  for (int i = 0; i < 100; ++i) mpm.step();
  const double fallen = 100.0 * options.dt * options.gravity;
  EXPECT_NEAR(mean_velocity(mpm.particles())[2], fallen, 1e-4 * std::abs(fallen));
  for (const auto& p : mpm.particles()) {
    EXPECT_NEAR(p.F[0], 1.0F, 1e-4F);
    EXPECT_NEAR(p.F[1], 0.0F, 1e-4F);
  }
}

TEST(SerialMpmTest, KeepsMomentumAndAngularMomentumWhileItRings) {
  SerialMpm::Options options;
  options.grid = 40;
  options.gravity = 0.0F;
  auto particles = cube(8, 0.3F);
  for (auto& p : particles) {
    // Stretched along x and spinning about z: elastic forces act, and must sum to nothing.
    p.F[0] = 1.05F;
    p.v = {-5.0F * (p.x[1] - 0.34F), 5.0F * (p.x[0] - 0.34F), 0.3F};
  }
  const auto angular = [](const std::vector<SerialMpm::Particle>& all) {
    double sum = 0.0;
    // Angular momentum of the particles and of their affine fields: APIC conserves the two
    // together, m(x×v + C terms).
    for (const auto& p : all) {
      const double inertia = 0.25 * 0.02 * 0.02;
      sum += p.mass * (p.x[0] * p.v[1] - p.x[1] * p.v[0] + inertia * (p.C[3] - p.C[1]));
    }
    return sum;
  };
  SerialMpm mpm(std::move(particles), options);
  mpm.step();  // the affine field is known from the first step on
  const double before = angular(mpm.particles());
  for (int i = 0; i < 50; ++i) mpm.step();
  EXPECT_NEAR(mean_velocity(mpm.particles())[2], 0.3, 1e-5);
  EXPECT_NEAR(angular(mpm.particles()) / before, 1.0, 2e-4);
}

TEST(SerialMpmTest, RingsAtTheFrequencyOfABar) {
  // A bar free at both ends, stretched along z in its first mode, nu = 0: f = c/(2L), c = √(E/ρ).
  SerialMpm::Options options;
  options.grid = 60;
  options.gravity = 0.0F;
  options.lambda = 0.0F;
  options.mu = 5e4F;  // E = 2μ
  options.dt = 2e-4F;
  constexpr int kLong = 64;
  std::vector<SerialMpm::Particle> bar;
  for (int i = 0; i < 8; ++i) {
    for (int j = 0; j < 8; ++j) {
      for (int k = 0; k < kLong; ++k) {
        SerialMpm::Particle p{};
        p.x = {0.4F + (static_cast<float>(i) + 0.5F) * kSeparation,
               0.4F + (static_cast<float>(j) + 0.5F) * kSeparation,
               0.2F + (static_cast<float>(k) + 0.5F) * kSeparation};
        p.F = {1, 0, 0, 0, 1, 0, 0, 0, 1};
        p.mass = kMass;
        p.volume = kSeparation * kSeparation * kSeparation;
        // First mode: v ∝ cos(πz/L), antisymmetric about the middle.
        p.v[2] = 0.1F * std::cos(3.14159265F * (static_cast<float>(k) + 0.5F) / kLong);
        bar.push_back(p);
      }
    }
  }
  SerialMpm mpm(std::move(bar), options);
  const double density = kMass / (kSeparation * kSeparation * kSeparation);
  const double length = kLong * kSeparation;
  const double period = 2.0 * length / std::sqrt(1e5 / density);
  // The velocity of the lower half changes sign at T/4 and at 3T/4.
  std::vector<double> crossings;
  double last = 1.0;
  for (int step = 1; crossings.size() < 2 && step < 4000; ++step) {
    mpm.step();
    double lower = 0.0;
    for (const auto& p : mpm.particles()) {
      if (p.x[2] < 0.2F + 0.5F * static_cast<float>(length)) lower += p.v[2];
    }
    if (lower * last < 0.0) crossings.push_back(static_cast<double>(step) * options.dt);
    last = lower;
  }
  ASSERT_EQ(crossings.size(), 2U);
  EXPECT_NEAR(2.0 * (crossings[1] - crossings[0]) / period, 1.0, 0.04);
}

}  // namespace
}  // namespace matterfit::bench
