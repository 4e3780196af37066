// SPDX-License-Identifier: GPL-3.0-or-later
// The correction beside a law in a simulation: derivatives against fourth-order differences of
// whole runs in double, what zeros change, and what it does to the substep.
#include "material/correction.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "base/error.hpp"
#include "mpm/simulation.hpp"
#include "mpm/step_limit.hpp"
#include "mpm/terms_for_test.hpp"

namespace matterfit::mpm {
namespace {

std::string name_of(Formulation formulation) {
  if (formulation == Formulation::kRenewed) return "renewed";
  return formulation == Formulation::kTotal ? "total" : "updated";
}

class CorrectedGradient : public ::testing::TestWithParam<Formulation> {};

INSTANTIATE_TEST_SUITE_P(Formulations, CorrectedGradient,
                         ::testing::Values(Formulation::kTotal, Formulation::kUpdated,
                                           Formulation::kRenewed),
                         [](const auto& info) { return name_of(info.param); });

class CorrectedLaw : public ::testing::TestWithParam<Formulation> {};

INSTANTIATE_TEST_SUITE_P(Formulations, CorrectedLaw,
                         ::testing::Values(Formulation::kTotal, Formulation::kUpdated,
                                           Formulation::kRenewed),
                         [](const auto& info) { return name_of(info.param); });

TEST_P(CorrectedGradient, AreThoseOfDifferences) {
  TermCase run(GetParam(), {});
  run.material.correction = {0.5, -0.1, 2.0, 0.2, 0.8};
  expect_gradient(run);
  const Gradient g = run.gradient<double>();
  for (std::size_t k = 0; k < material::kCorrectionSize; ++k) {
    expect_slope(run, g.schedule, "correction " + std::to_string(k),
                 g.bodies[0].material.correction[k], 2e-3,
                 [k](TermCase& c, double by) { c.material.correction[k] += by; });
  }
  expect_slope(run, g.schedule, "nu", g.bodies[0].material.poisson_ratio, 1e-4,
               [](TermCase& c, double by) { c.material.poisson_ratio += by; });
}

/// So that a fit that begins without one knows where to.
TEST_P(CorrectedGradient, AreKnownAtZero) {
  TermCase run(GetParam(), {});
  run.material.correction.assign(material::kCorrectionSize, 0.0);
  const Gradient g = run.gradient<double>();
  for (std::size_t k = 0; k < material::kCorrectionSize; ++k) {
    expect_slope(run, g.schedule, "correction " + std::to_string(k),
                 g.bodies[0].material.correction[k], 2e-3,
                 [k](TermCase& c, double by) { c.material.correction[k] += by; });
  }
}

/// A ball that turns so fast that it widens.
Scene spinning(Formulation formulation, const std::vector<double>& correction) {
  Scene scene = ball(formulation, Vec3d::Zero());
  scene.end_frame = 4;
  scene.fps = 500.0;
  scene.bodies[0].spin = Vec3d(0.0, 0.0, 200.0);
  scene.bodies[0].material.correction = correction;
  return scene;
}

TEST_P(CorrectedLaw, OfZerosIsTheLawBitForBit) {
  const FrameState without = last_state(spinning(GetParam(), {}));
  const FrameState with = last_state(spinning(GetParam(), {0.0, 0.0, 0.0, 0.0, 0.0}));
  EXPECT_EQ(with.bodies[0].positions, without.bodies[0].positions);
  EXPECT_EQ(with.bodies[0].velocities, without.bodies[0].velocities);
  EXPECT_EQ(step_limit(spinning(GetParam(), {})),
            step_limit(spinning(GetParam(), {0.0, 0.0, 0.0, 0.0, 0.0})));
}

TEST_P(CorrectedLaw, ThatStiffensIsAStifferBody) {
  const auto width = [](const FrameState& state) {
    double most = 0.0;
    for (const Vec3f& x : state.bodies[0].positions) {
      most = std::max(most, static_cast<double>(x.head<2>().norm()));
    }
    return most;
  };
  const double plain = width(last_state(spinning(GetParam(), {})));
  const Scene stiff = spinning(GetParam(), {3.0, 3.0, 0.0, 0.0, 0.0});
  EXPECT_LT(width(last_state(stiff)), plain - 1e-3);
  EXPECT_GT(width(last_state(spinning(GetParam(), {-0.3, -0.3, 0.0, 0.0, 0.0}))), plain + 1e-3);
  const FrameState one = last_state(stiff, 1);
  EXPECT_EQ(one.bodies[0].positions, last_state(stiff, 3).bodies[0].positions);
}

TEST_P(CorrectedLaw, ThatStiffensShortensTheSubstep) {
  Scene plain = spinning(GetParam(), {});
  Scene stiff = spinning(GetParam(), {0.0, 0.0, 10.0, 0.0, 0.0});
  for (Scene* scene : {&plain, &stiff}) {
    scene->fps = 50.0;
    scene->bodies[0].spin.setZero();
  }
  const auto first_dt = [](const Scene& scene) {
    Simulation simulation(scene, std::make_shared<Arena>(1), {});
    return simulation.advance(Interrupter()).dt;
  };
  const material::Material& material = stiff.bodies[0].material;
  const double own = material.p_wave_modulus();
  const double ratio = std::sqrt(1.0 + material::Correction(material).modulus_bound() / own);
  EXPECT_GT(ratio, 2.0);
  EXPECT_NEAR(step_limit(plain) / step_limit(stiff), ratio, 0.02 * ratio);
  EXPECT_NEAR(first_dt(plain) / first_dt(stiff), ratio, 0.15 * ratio);
}

/// A run with a substep that is too long fails with an error, and gives no numbers.
TEST_P(CorrectedLaw, ThatExplodesIsAnError) {
  Scene scene = spinning(GetParam(), {30.0, 30.0, 30.0, 0.0, 30.0});
  scene.end_frame = 20;
  scene.dt = 2e-3;
  EXPECT_THROW((void)last_state(scene), Error);
}

}  // namespace
}  // namespace matterfit::mpm
