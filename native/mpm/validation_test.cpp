// SPDX-License-Identifier: GPL-3.0-or-later
// Coarse versions of the cases of docs/validation.md.
#include <gtest/gtest.h>

#include <cmath>

#include "mpm/validation_flows_for_test.hpp"
#include "mpm/validation_solids_for_test.hpp"

namespace matterfit::mpm::validation {
namespace {

class Validation : public ::testing::TestWithParam<Formulation> {};
INSTANTIATE_TEST_SUITE_P(Solver, Validation,
                         ::testing::Values(Formulation::kTotal, Formulation::kUpdated),
                         [](const auto& info) {
                           return info.param == Formulation::kTotal ? "Total" : "Updated";
                         });

TEST_P(Validation, BlockSticksAtTheFrictionAngleAndSlidesBeyond) {
  for (const double offset : {0.0, 0.4, 0.7}) {
    const Slide stick = slide_block(GetParam(), 0.95, offset, 2);
    EXPECT_LT(std::abs(stick.creep_early), 1e-5) << offset;
    EXPECT_LT(std::abs(stick.creep_late), 1e-5) << offset;
    const Slide slip = slide_block(GetParam(), 1.05, offset, 2);
    EXPECT_NEAR(slip.acceleration / slip.expected, 1.0, 0.02) << offset;
  }
}

TEST_P(Validation, FreeBarRingsAtTheSpeedOfSound) {
  const Frequency bar = bar_frequency({GetParam(), false, 2});
  // Ten cells along: with lumped masses the total Lagrangian bar would be 1.2 % low.
  const double least = GetParam() == Formulation::kTotal ? 0.003 : 0.015;
  EXPECT_NEAR(bar.measured / bar.expected, 1.0, least);
  EXPECT_LT(std::abs(bar.damping), 0.002);
}

/// Where nodes are must not matter: not in the world (updated), not in the body (total).
TEST_P(Validation, ReboundDoesNotDependOnTheNodes) {
  const bool total = GetParam() == Formulation::kTotal;
  std::vector<double> rebound;
  std::vector<double> deepest;
  for (const double offset : {0.0, 0.2, 0.5, 0.7}) {
    const Drop drop =
        drop_ball({GetParam(), shape::ContactMethod::kParticle, total ? 12 : 8, offset});
    rebound.push_back(drop.rebound);
    deepest.push_back(drop.deepest);
  }
  // Updated: .65 % before the default spring firmed up with depth, 1.03 % since.
  EXPECT_LT(spread(rebound) / average(rebound), total ? 0.01 : 0.012);
  EXPECT_LT(spread(deepest), 5e-5);
}

/// Timoshenko's cantilever, the clamp on a boundary of cells and off it.
TEST(KnownAnswers, CantileverByBeamTheory) {
  for (const double offset : {0.0, 0.5, 0.8}) {
    const Cantilever beam = cantilever({Formulation::kTotal, true, 4, offset});
    EXPECT_NEAR(beam.sag / kBeam.sag(), 1.0, 0.02) << offset;
    EXPECT_NEAR(beam.frequency / kBeam.frequency(), 1.0, 0.015) << offset;
    EXPECT_LT(std::abs(beam.damping), 0.002) << offset;
  }
}

/// A free-slip floor lets the front run as fast as measured or faster; a sticky one holds it back.
TEST(KnownAnswers, DamBreakNeedsAFreeFloor) {
  const auto speed = [](shape::ContactKind floor) {
    const std::vector<double> z = dam_break(0.05715, {1.219, 3.345}, floor, 6);
    return (z[1] - z[0]) / (3.345 - 1.219);
  };
  const double measured = (4.134 - 1.474) / (3.345 - 1.219);
  EXPECT_NEAR(speed(shape::ContactKind::kSeparating) / measured, 1.0, 0.15);
  EXPECT_LT(speed(shape::ContactKind::kGlue) / measured, 0.9);
}

/// Poiseuille's flow under its own weight, the walls anywhere in their cells.
TEST(KnownAnswers, FluidFallsBetweenStickyWallsAsAParabola) {
  const Shear flow = channel_flow(8, 0.3, shape::ContactMethod::kParticle);
  EXPECT_NEAR(flow.centre / flow.expected, 1.0, 0.06);
  EXPECT_NEAR(flow.wall_slip, 0.0, 0.02);
}

/// A hanging bar stretches as its law says, ν = 0, P(λ) = ρ g (L − X), E = 2μ.
TEST(KnownAnswers, HangingBarByEachLawsClosedForm) {
  using material::Law;
  constexpr double kLength = 0.08;
  constexpr double kModulus = 5e3;
  constexpr double kDensity = 1000;
  // P(λ)/E: fixed corotated λ − 1, Hencky ln λ/λ.
  const auto stress = [](Law law, double s) {
    return law == Law::kStvkHencky ? std::log(s) / s : s - 1;
  };
  for (const Law law : {Law::kFixedCorotated, Law::kStvkHencky}) {
    Body body = box_body("bar", Vec3d::Zero(), Vec3d(kLength, 0.02, 0.02), 0.005);
    body.formulation = Formulation::kTotal;
    body.material.law = law;
    body.material.youngs_modulus = kModulus;
    body.material.poisson_ratio = 0.0;
    body.material.damping_shear = body.material.damping_bulk = 20.0;
    Pin pin;
    pin.region = Pin::Region::kPlane;
    pin.normal = Vec3d::UnitX();
    body.pins.push_back(pin);
    Scene scene;
    scene.dx = 0.01;
    scene.fps = 50;
    scene.end_frame = 76;
    scene.gravity = shape::Keyed<Vec3d>(Vec3d(9.81, 0, 0));
    const Points rest = body.rest;
    scene.bodies.push_back(std::move(body));
    double measured = 0;
    run(scene, 1, [&](const FrameState& state) {
      measured = mean_where(state.bodies[0].positions, rest,
                            [](const Vec3d& x) { return x[0] > 0.075; })[0];
      return true;
    });
    double expected = 0;
    constexpr int kSteps = 2000;
    const double to = kLength - 0.0025;
    for (int i = 0; i < kSteps; ++i) {
      const double x = (i + 0.5) * to / kSteps;
      const double wanted = kDensity * 9.81 * (kLength - x) / kModulus;
      double low = 1.0;
      double high = 2.0;
      for (int k = 0; k < 50; ++k) {
        const double middle = 0.5 * (low + high);
        (stress(law, middle) < wanted ? low : high) = middle;
      }
      expected += low * to / kSteps;
    }
    EXPECT_NEAR((measured - to) / (expected - to), 1.0, 0.01) << material::traits(law).name;
  }
}

/// Without gravity and floor a body that turns, stretches and rings keeps its momenta.
TEST_P(Validation, MomentaAreKept) {
  Body body = box_body("cube", Vec3d(-0.03, -0.03, -0.03), Vec3d(0.03, 0.03, 0.03), 0.005);
  body.formulation = GetParam();
  body.material.youngs_modulus = 2e4;
  for (const Vec3d& x : body.rest) {
    body.particle_velocities.emplace_back(0.3 + 4 * x[0] - 3 * x[1], 3 * x[0] - 4 * x[1], 2 * x[2]);
  }
  Scene scene;
  scene.dx = 0.01;
  scene.fps = 100;
  scene.end_frame = 31;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
  scene.bodies.push_back(std::move(body));
  std::vector<Vec3d> linear;
  std::vector<double> angular;
  run(scene, 1, [&](const FrameState& state) {
    const BodyState& b = state.bodies[0];
    const Vec3d centre = mean(b.positions);
    Vec3d l = Vec3d::Zero();
    for (std::size_t p = 0; p < b.positions.size(); ++p) {
      l += (b.positions[p].cast<double>() - centre).cross(b.velocities[p].cast<double>());
    }
    linear.push_back(mean(b.velocities));
    angular.push_back(l[2]);
    return true;
  });
  EXPECT_LT((linear.back() - Vec3d(0.3, 0, 0)).norm(), 1e-5);
  // The plain sum over particles leaves out what an updated body carries in its affine velocities.
  EXPECT_NEAR(angular.back() / angular.front(), 1.0,
              GetParam() == Formulation::kTotal ? 0.03 : 0.1);
}

}  // namespace
}  // namespace matterfit::mpm::validation
