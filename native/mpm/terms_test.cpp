// SPDX-License-Identifier: GPL-3.0-or-later
// Effects as terms of a simulation, in the three formulations: their derivatives against
// fourth-order differences of whole runs in double, motions with a known answer, and what absent
// ones change.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <tuple>

#include "base/error.hpp"
#include "effects/catalogue.hpp"
#include "mpm/scene_check.hpp"
#include "mpm/simulation.hpp"
#include "mpm/terms_for_test.hpp"

namespace matterfit::mpm {
namespace {

using effects::Effect;
using effects::make_effect;

std::string formulation_name(Formulation formulation) {
  if (formulation == Formulation::kRenewed) return "renewed";
  return formulation == Formulation::kTotal ? "total" : "updated";
}

/// An effect of each kind that does something to GradientCase's bar.
Effect strong(const std::string& type) {
  Effect effect = make_effect(type);
  if (type == "drag_linear") set(effect, "rate", 2.0);
  if (type == "drag_quadratic" || type == "wind") {
    set(effect, "drag_coefficient", 0.7);
    set(effect, "air_density", 300.0);
    set(effect, "area", 0.02);
  }
  if (type == "wind") set(effect, "velocity", Vec3d(-1.0, 2.0, 0.5));
  if (type == "force_field") {
    set(effect, "center", Vec3d(0.1, 0.0, 0.25));
    set(effect, "radius", 0.25);
    set(effect, "acceleration", Vec3d(20.0, -10.0, 30.0));
  }
  if (type == "buoyancy") set(effect, "medium_density", 400.0);
  if (type == "vortex") {
    set(effect, "center", Vec3d(0.1, 0.0, 0.2));
    set(effect, "axis", Vec3d(0.3, -0.2, 1.5));
    set(effect, "radius", 0.4);
    set(effect, "strength", 40.0);
  }
  if (type == "frame_acceleration") {
    set(effect, "acceleration", Vec3d(10.0, 5.0, -7.0));
    set(effect, "frequency", 20.0);
    set(effect, "phase", 30.0);
  }
  if (type == "stiffness_inclusion") {
    set(effect, "center", Vec3d(0.03, 0.02, 0.26));
    // Around the whole bar: at its edge the field has a kink in its third derivative.
    set(effect, "radius", 0.3);
    set(effect, "modulus", 2e5);
  }
  if (type == "stiffness_gradient") {
    set(effect, "center", Vec3d(0.03, 0.02, 0.26));
    set(effect, "slope", Vec3d(1e5, 3e5, -5e5));
  }
  if (type == "fibres") {
    set(effect, "direction", Vec3d(1.0, 0.5, 2.0));
    set(effect, "modulus", 1e5);
  }
  if (type == "strain_stiffening") {
    set(effect, "modulus", 3e5);
    set(effect, "exponent", 1.2);
  }
  if (type == "second_invariant") set(effect, "modulus", 1e5);
  return effect;
}

std::vector<std::string> term_names() {
  std::vector<std::string> names;
  for (const effects::EffectType* row : effects::catalogue()) {
    if (row->make != nullptr) names.push_back(row->name);
  }
  return names;
}

class EachTerm : public ::testing::TestWithParam<std::tuple<Formulation, std::string>> {};

TEST_P(EachTerm, HasItsDerivatives) {
  const auto& [formulation, type] = GetParam();
  const TermCase run(formulation, {strong(type)});
  ASSERT_FALSE(is_neutral(run.with[0]));
  expect_gradient(run);
}

INSTANTIATE_TEST_SUITE_P(Catalogue, EachTerm,
                         ::testing::Combine(::testing::Values(Formulation::kTotal,
                                                              Formulation::kUpdated,
                                                              Formulation::kRenewed),
                                            ::testing::ValuesIn(term_names())),
                         [](const auto& info) {
                           return std::get<1>(info.param) + "_" +
                                  formulation_name(std::get<0>(info.param));
                         });

Vec3d mean_of(const std::vector<Vec3f>& values) {
  Vec3d sum = Vec3d::Zero();
  for (const Vec3f& value : values) sum += value.cast<double>();
  return sum / static_cast<double>(values.size());
}

class Flight : public ::testing::TestWithParam<Formulation> {};

INSTANTIATE_TEST_SUITE_P(Formulations, Flight,
                         ::testing::Values(Formulation::kTotal, Formulation::kUpdated,
                                           Formulation::kRenewed),
                         [](const auto& info) { return formulation_name(info.param); });

TEST_P(Flight, UnderLinearDragDecaysExponentially) {
  Scene scene = ball(GetParam(), Vec3d(3.0, 0.0, 1.0));
  scene.effects.push_back(strong("drag_linear"));
  const BodyState end = last_state(scene).bodies[0];
  // v₀ exp(−k t), t = .5 s; velocities are those of half a substep before.
  EXPECT_NEAR(mean_of(end.velocities).x(), 3.0 * std::exp(-1.0), 5e-3);
  EXPECT_NEAR(mean_of(end.velocities).z(), std::exp(-1.0), 2e-3);
  EXPECT_NEAR(mean_of(end.positions).x(), 1.5 * (1.0 - std::exp(-1.0)), 2e-3);
}

TEST_P(Flight, UnderQuadraticDragHasTheBodysOwnCoefficient) {
  Scene scene = ball(GetParam(), Vec3d(6.0, 0.0, 0.0));
  Effect drag = make_effect("drag_quadratic");
  set(drag, "drag_coefficient", 0.47);
  set(drag, "air_density", 20.0);
  scene.effects.push_back(drag);
  const Body& body = scene.bodies[0];
  double volume = 0.0;
  for (const double v : body.volumes) volume += v;
  const double area = std::numbers::pi * std::pow(0.75 * volume / std::numbers::pi, 2.0 / 3.0);
  const double k = 0.5 * 20.0 * 0.47 * area / (body.density * volume);  // v' = −k v²
  const BodyState end = last_state(scene).bodies[0];
  EXPECT_NEAR(mean_of(end.velocities).x(), 6.0 / (1.0 + k * 6.0 * 0.5), 1e-2);
  EXPECT_NEAR(mean_of(end.positions).x(), std::log(1.0 + k * 6.0 * 0.5) / k, 3e-3);
}

TEST_P(Flight, InWindAndStillAirIsThatInMovingAir) {
  const Vec3d air(-1.0, 2.0, 0.5);
  Scene scene = ball(GetParam(), Vec3d(2.0, 1.0, 0.0));
  scene.effects = {strong("drag_quadratic"), strong("wind")};
  Scene moving = ball(GetParam(), Vec3d(2.0, 1.0, 0.0) - air);
  moving.effects = {strong("drag_quadratic")};
  const Vec3d seen = mean_of(last_state(scene).bodies[0].positions);
  const Vec3d from_the_air = mean_of(last_state(moving).bodies[0].positions);
  EXPECT_LT((seen - from_the_air - 0.5 * air).norm(), 1e-3);
}

TEST_P(Flight, UnderBuoyancyMovesAsTheDisplacedMassSays) {
  Scene scene = ball(GetParam(), Vec3d::Zero());
  scene.gravity = shape::Keyed<Vec3d>(Vec3d(0.0, 0.0, -10.0));
  Effect buoyancy = make_effect("buoyancy");
  set(buoyancy, "medium_density", 100.0);
  scene.effects.push_back(buoyancy);
  // (ρ_m − ρ) g / (ρ + ½ ρ_m) = 5 m/s² upwards, for .5 s.
  EXPECT_NEAR(mean_of(last_state(scene).bodies[0].positions).z(), 0.125 * 5.0, 2e-3);
}

TEST_P(Flight, IsTheSameBitForBitWithNeutralEffects) {
  Scene scene = ball(GetParam(), Vec3d(3.0, 1.0, 2.0));
  const FrameState without = last_state(scene);
  for (const std::string& name : term_names()) {
    Effect neutral = make_effect(name);
    for (const effects::EffectParameter& parameter : neutral.type->parameters) {
      if (parameter.neutral) set(neutral, parameter.key, *parameter.neutral);
    }
    EXPECT_TRUE(is_neutral(neutral)) << name;
    scene.effects.push_back(neutral);
  }
  const FrameState with = last_state(scene);
  EXPECT_EQ(with.bodies[0].positions, without.bodies[0].positions);
  EXPECT_EQ(with.bodies[0].velocities, without.bodies[0].velocities);
}

TEST_P(Flight, HasTheSameBitsForAnyNumberOfThreads) {
  Scene scene = ball(GetParam(), Vec3d(3.0, 1.0, 2.0));
  scene.end_frame = 3;
  for (const std::string& name : term_names()) scene.effects.push_back(strong(name));
  const FrameState one = last_state(scene, 1);
  EXPECT_EQ(one.bodies[0].positions, last_state(scene, 3).bodies[0].positions);
}

/// An effect that does nothing yet has the derivative that says what it would do.
TEST(NeutralEffects, HaveDerivatives) {
  for (const Formulation formulation :
       {Formulation::kTotal, Formulation::kUpdated, Formulation::kRenewed}) {
    // Both are vectors, so that differences may go to either side of 0.
    TermCase run(formulation, {strong("wind"), strong("force_field")});
    set(run.with[0], "velocity", 0.0);
    set(run.with[1], "acceleration", 0.0);
    ASSERT_TRUE(is_neutral(run.with[0]) && is_neutral(run.with[1]));
    expect_gradient(run);
  }
}

TEST(SceneEffects, AreChecked) {
  const auto refusal = [](const Effect& effect) -> std::string {
    Scene scene = ball(Formulation::kTotal, Vec3d::Zero());
    scene.effects.push_back(effect);
    try {
      check_scene(scene);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  Effect wind = make_effect("wind");
  EXPECT_EQ(refusal(wind), "");
  wind.body = "cube";
  EXPECT_EQ(refusal(wind), "scene.effects[0].body: there is no body 'cube'.");
  wind.body = "ball";
  set(wind, "drag_coefficient", -1.0);
  EXPECT_EQ(refusal(wind), "scene.effects[0].drag_coefficient = -1 must lie between 0 and 100.");
}

}  // namespace
}  // namespace matterfit::mpm
