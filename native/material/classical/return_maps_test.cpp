// SPDX-License-Identifier: GPL-3.0-or-later
// Every plastic law's return map against its own equations, in double.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/vec.hpp"
#include "material/classical/laws_for_test.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {
namespace {

/// The stress of the returned F is the stress that was reported, and F keeps its principal axes.
void expect_consistent(const Material& m, const Mat3d& f, const Result& r) {
  Material elastic = m;
  elastic.law = Law::kStvkHencky;
  expect_near(r.tau, closed_form(elastic, r.elastic), 2e-9 * m.p_wave_modulus());
  expect_near(hencky(f) * hencky(r.elastic), hencky(r.elastic) * hencky(f), 1e-9);
}

TEST(Laws, VonMisesYieldsAtTheUniaxialStress) {
  // Uniaxial Kirchhoff stress exactly at τ_Y: elastic below, on the surface above.
  Material m = material_of(Law::kVonMises);
  m.hardening = 0.0;
  const double yield_strain = m.yield_stress / m.youngs_modulus;
  const auto uniaxial = [&](double strain) {
    const Vec3d e = strain * Vec3d(1, -m.poisson_ratio, -m.poisson_ratio);
    const Vec3d sigma = e.array().exp();
    return Mat3d(sigma.asDiagonal());
  };
  const Result below = run(m, uniaxial(0.999 * yield_strain));
  EXPECT_EQ(below.strain, 0.0);
  EXPECT_NEAR(below.tau(0, 0), 0.999 * m.yield_stress, 1e-9 * m.yield_stress);
  EXPECT_NEAR(below.tau(1, 1), 0.0, 1e-9 * m.yield_stress);
  const Result above = run(m, uniaxial(1.001 * yield_strain));
  EXPECT_GT(above.strain, 0.0);
  EXPECT_NEAR(dev(above.tau).norm(), std::sqrt(2.0 / 3.0) * m.yield_stress, 1e-9 * m.yield_stress);
}

TEST(Laws, VonMisesReturnsToTheHardenedSurface) {
  for (const double hardening : {0.0, 2e4, 1e6}) {
    Material m = material_of(Law::kVonMises);
    m.hardening = hardening;
    for (const Mat3d& f : deformations(0.5)) {
      const double before = 0.02;
      const Result r = run(m, f, before);
      const double radius = std::sqrt(2.0 / 3.0) * (m.yield_stress + hardening * r.strain);
      const double trial = 2 * m.mu() * dev(hencky(f)).norm();
      expect_consistent(m, f, r);
      EXPECT_NEAR(r.elastic.determinant(), f.determinant(), 1e-10);
      if (trial <= std::sqrt(2.0 / 3.0) * (m.yield_stress + hardening * before)) {
        EXPECT_EQ(r.strain, before);
        expect_near(r.elastic, f, 0.0);
        continue;
      }
      EXPECT_NEAR(dev(r.tau).norm(), radius, 1e-9 * m.p_wave_modulus());
      // Equivalent plastic strain √(2/3) |Δεᵖ|.
      const double flow = (dev(hencky(f)) - dev(hencky(r.elastic))).norm();
      EXPECT_NEAR(r.strain - before, std::sqrt(2.0 / 3.0) * flow, 1e-9);
      expect_near(run(m, r.elastic, r.strain).elastic, r.elastic, 1e-9);  // a second return: none
    }
  }
}

TEST(Laws, HerschelBulkleySolvesItsFlowRule) {
  for (const double exponent : {0.06, 0.2, 0.5, 1.0, 1.7, 5.0}) {
    for (const double viscosity : {1e-3, 1.0, 40.0, 1e4}) {
      for (const double dt : {1e-6, 1e-4, 1e-2}) {
        Material m = material_of(Law::kHerschelBulkley);
        m.exponent = exponent;
        m.viscosity = viscosity;
        m.yield_stress = 200.0;
        for (const Mat3d& f : deformations(0.3, 6)) {
          const double bound = std::sqrt(2.0 / 3.0) * m.yield_stress;
          const double trial = 2 * m.mu() * dev(hencky(f)).norm();
          const Result r = run(m, f, 0.0, dt);
          expect_consistent(m, f, r);
          if (trial <= bound) {
            expect_near(r.elastic, f, 0.0);
            continue;
          }
          const double s = dev(r.tau).norm();
          const double two_mu_hat = 2 * m.mu() * (f * f.transpose()).trace() / 3.0;
          const double rate = (trial - s) / (two_mu_hat * dt);
          // η γ̇ⁿ = |s| − bound with η = 2 η_d, measured against what there is to split.
          SCOPED_TRACE("exponent " + std::to_string(exponent) + " viscosity " +
                       std::to_string(viscosity) + " dt " + std::to_string(dt));
          ASSERT_GE(rate, -1e-6 * trial / (two_mu_hat * dt));
          const double over = s - bound;
          const double expected_rate =
              std::pow(std::max(over, 0.0) / (2 * viscosity), 1 / exponent);
          const double split = over + two_mu_hat * dt * expected_rate;
          // Where the rate is a steep function of the stress, compare the stress instead.
          const double expected_over = 2 * viscosity * std::pow(std::max(rate, 0.0), exponent);
          const double error =
              std::min(std::abs(split - (trial - bound)), std::abs(over - expected_over));
          EXPECT_LE(error, 1e-7 * (trial - bound) + 1e-9 * m.p_wave_modulus());
        }
      }
    }
  }
}

TEST(Laws, HerschelBulkleyWithoutViscosityIsVonMises) {
  Material a = material_of(Law::kHerschelBulkley);
  a.viscosity = 0.0;
  Material b = a;
  b.law = Law::kVonMises;
  for (const Mat3d& f : deformations(0.3)) {
    const Result x = run(a, f);
    const Result y = run(b, f);
    expect_near(x.tau, y.tau, 1e-10 * a.p_wave_modulus());
    EXPECT_NEAR(x.strain, y.strain, 1e-12);
  }
}

TEST(Laws, DruckerPragerStaysInItsCone) {
  for (const double phi : {0.0, 1e-4, 25.0, 40.0}) {
    for (const double cohesion : {0.0, 500.0}) {
      Material m = material_of(Law::kDruckerPrager);
      m.friction_angle = phi;
      m.cohesion = cohesion;
      const double radians = phi * std::acos(-1.0) / 180.0;
      const double scale = std::sqrt(2.0 / 3.0) * 2 / (3 - std::sin(radians));
      int slid = 0;
      int torn = 0;
      for (const Mat3d& f : deformations(0.05, 60)) {
        const Result r = run(m, f);
        expect_consistent(m, f, r);
        // |s| + α tr τ ≤ α 3 c cot φ = scale · 3 c cos φ.
        const double alpha = scale * std::sin(radians);
        const double bound = 3 * scale * cohesion * std::cos(radians);
        const double trial_trace = hencky(f).trace();
        const double tip = phi > 0.0 ? cohesion / std::tan(radians) / (3 * m.lambda() + 2 * m.mu())
                                     : (cohesion > 0.0 ? 1.0 : 0.0);
        if (trial_trace > 3 * tip) {
          ++torn;
          expect_near(hencky(r.elastic), tip * Mat3d::Identity(), 1e-10);
          continue;
        }
        EXPECT_NEAR(hencky(r.elastic).trace(), trial_trace, 1e-10);
        const double value = dev(r.tau).norm() + alpha * r.tau.trace() - bound;
        const Mat3d trial = 2 * m.mu() * hencky(f) + m.lambda() * trial_trace * Mat3d::Identity();
        const double trial_value = dev(trial).norm() + alpha * trial.trace() - bound;
        EXPECT_LE(value, 1e-9 * m.p_wave_modulus());
        if (trial_value > 0) {
          ++slid;
          EXPECT_NEAR(value, 0.0, 1e-9 * m.p_wave_modulus());
          const double flow = (dev(hencky(f)) - dev(hencky(r.elastic))).norm();
          EXPECT_NEAR(r.strain, std::sqrt(2.0 / 3.0) * flow, 1e-10);
        } else {
          expect_near(r.elastic, f, 0.0);
        }
      }
      EXPECT_GT(slid, 0);
      if (cohesion == 0.0) {
        EXPECT_GT(torn, 0);
      }
    }
  }
}

TEST(Laws, SandWithoutCohesionCarriesNoTension) {
  const Material m = [] {
    Material sand = material_of(Law::kDruckerPrager);
    sand.cohesion = 0.0;
    return sand;
  }();
  const Result r = run(m, 1.01 * Mat3d::Identity());
  EXPECT_LE(r.tau.norm(), 1e-12 * m.p_wave_modulus());
  expect_near(r.elastic, Mat3d::Identity(), 1e-14);
}

}  // namespace
}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
