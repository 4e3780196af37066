// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench/reference_law.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace matterfit::bench {
namespace {

constexpr double kStep = 1e-4;

Mat3d deviator(const Mat3d& tau) { return tau - tau.trace() / 3.0 * Mat3d::Identity(); }

/// Velocity gradient that gives the strain `strain` in one step.
Mat3d stretching(const Vec3d& strain) { return Mat3d((strain / kStep).asDiagonal()); }

TEST(ReferenceLaw, SolidsHaveYoungsModulusAtSmallStrain) {
  for (const ReferenceLaw law : {ReferenceLaw::kNeoHookean, ReferenceLaw::kVonMises}) {
    ReferenceMaterial m;
    m.law = law;
    m.yield_stress = 1e9;
    ReferenceState state;
    constexpr double kStrain = 1e-6;
    const Mat3d tau =
        advance(m, stretching({kStrain, -m.poisson_ratio * kStrain, -m.poisson_ratio * kStrain}),
                kStep, state);
    EXPECT_NEAR(tau(0, 0) / (m.youngs_modulus * kStrain), 1.0, 1e-4);
    EXPECT_NEAR(tau(1, 1) / (m.youngs_modulus * kStrain), 0.0, 1e-4);
  }
}

TEST(ReferenceLaw, FluidHasItsBulkModulusAndViscosity) {
  ReferenceMaterial m;
  m.law = ReferenceLaw::kNewtonian;
  m.bulk_modulus = 7e5;
  m.viscosity = 20.0;
  ReferenceState state;
  Mat3d shear = Mat3d::Zero();
  shear(0, 1) = 3.0;
  Mat3d tau = advance(m, shear, kStep, state);
  EXPECT_DOUBLE_EQ(tau(0, 1), 60.0);
  EXPECT_DOUBLE_EQ(tau(1, 0), 60.0);
  EXPECT_DOUBLE_EQ(tau.trace(), 0.0);
  m.viscosity = 0.0;
  tau = advance(m, stretching({-1e-6, 0, 0}), kStep, state);
  EXPECT_NEAR(tau(2, 2), -0.7, 1e-5);
}

TEST(ReferenceLaw, PlasticineStopsAtItsUniaxialYieldStress) {
  ReferenceMaterial m;
  m.law = ReferenceLaw::kVonMises;
  m.yield_stress = 500.0;
  ReferenceState state;
  for (int i = 0; i < 20; ++i) {
    const Mat3d tau = advance(m, stretching({2e-3, -1e-3, -1e-3}), kStep, state);
    EXPECT_LE(deviator(tau).norm(), std::sqrt(2.0 / 3.0) * 500.0 * (1.0 + 1e-9));
  }
  // What flowed is forgotten: the elastic strain is the yield stress over 2μ, whatever came before.
  const Mat3d tau = advance(m, Mat3d::Zero(), kStep, state);
  EXPECT_NEAR(tau(0, 0) - tau(1, 1), 500.0, 1e-4);
  EXPECT_NEAR(state.b.determinant(), 1.0, 2e-4);
}

TEST(ReferenceLaw, ViscoplasticStressIsYieldStressPlusViscousPart) {
  // Steady shear of a Bingham solid: |s| = √(2/3) τ_Y + 2 η |dev D|, here in pure shear at rate D.
  ReferenceMaterial m;
  m.law = ReferenceLaw::kHerschelBulkley;
  m.yield_stress = 100.0;
  m.viscosity = 5.0;
  m.youngs_modulus = 1e5;
  ReferenceState state;
  constexpr double kRate = 10.0;
  const Vec3d flow(kRate * kStep, -kRate * kStep, 0);
  Mat3d tau;
  for (int i = 0; i < 200; ++i) tau = advance(m, stretching(flow), kStep, state);
  const double expected = std::sqrt(2.0 / 3.0) * 100.0 + 2.0 * 5.0 * std::sqrt(2.0) * kRate;
  EXPECT_NEAR(deviator(tau).norm() / expected, 1.0, 0.01);
}

TEST(ReferenceLaw, SandBearsNoTensionAndShearUpToItsCone) {
  ReferenceMaterial m;
  m.law = ReferenceLaw::kDruckerPrager;
  m.friction_angle = 30.0;
  ReferenceState apart;
  EXPECT_LT(advance(m, stretching({1e-3, 0, 0}), kStep, apart).norm(), 1e-9);
  ReferenceState pressed;
  (void)advance(m, stretching({-1e-3, -1e-3, -1e-3}), kStep, pressed);
  Mat3d tau;
  for (int i = 0; i < 10; ++i) tau = advance(m, stretching({1e-3, 0, -1e-3}), kStep, pressed);
  const double sine = std::sin(30.0 * std::numbers::pi / 180.0);
  const double alpha = std::sqrt(2.0 / 3.0) * 2.0 * sine / (3.0 - sine);
  EXPECT_NEAR(deviator(tau).norm() / (-alpha * tau.trace()), 1.0, 1e-6);
}

TEST(ReferenceLaw, RubberStiffensAndIsSofterOnTheWayBack) {
  ReferenceMaterial m;
  m.law = ReferenceLaw::kMullins;
  m.stiffening = 3.0;
  m.softening = 0.4;
  ReferenceState state;
  constexpr double kFar = 0.02;  // of e₁₂ a step
  Mat3d shear = Mat3d::Zero();
  shear(0, 1) = shear(1, 0) = kFar / kStep;
  const auto moduli = [&](double sign, int steps) {
    std::vector<double> found;
    for (int i = 0; i < steps; ++i) {
      const Mat3d tau = advance(m, sign * shear, kStep, state);
      const double strain =
          0.25 * std::log((state.b(0, 0) + state.b(0, 1)) / (state.b(0, 0) - state.b(0, 1)));
      found.push_back(tau(0, 1) / (2.0 * m.mu() * strain));
    }
    return found;
  };
  const auto there = moduli(1.0, 10);
  const auto back = moduli(-1.0, 9);
  // (I + dt D)² of b: the strain after ten steps is 10 · ln of its stretches.
  const double far = 5.0 * std::log((1.0 + kFar) / (1.0 - kFar)) * std::sqrt(2.0);
  EXPECT_NEAR(there.back(), 1.0 + 3.0 * far, 1e-4);
  EXPECT_GT(there.back(), there.front() + 0.5);
  for (std::size_t i = 0; i < back.size(); ++i) EXPECT_LT(back[i], there[there.size() - 2 - i]);
  // At no strain six tenths of μ are left, whatever came before.
  EXPECT_NEAR(back.back(), 0.6 * (1.0 + 0.3 * far) + 0.04, 0.02);
  // Out again by the softer way, and from the largest strain on by the first one.
  const auto again = moduli(1.0, 9);
  EXPECT_NEAR(again[4], back[3], 2e-3);
  EXPECT_NEAR(again.back(), there.back(), 2e-3);
}

TEST(ReferenceLaw, TurningAloneGivesNoStress) {
  ReferenceMaterial m;
  m.law = ReferenceLaw::kVonMises;
  m.yield_stress = 1e4;
  ReferenceState state;
  Mat3d turning;
  turning << 0, -3, 0, 3, 0, 0, 0, 0, 0;
  Mat3d tau;
  for (int i = 0; i < 100; ++i) tau = advance(m, turning, 1e-5, state);
  // (I + dt W) is a rotation up to dt²: the strain is 100 · ½ (3e-5)².
  EXPECT_LT(tau.norm(), 1e5 * 2e-7);
}

}  // namespace
}  // namespace matterfit::bench
