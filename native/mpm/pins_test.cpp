// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"
#include "mpm/validation_solids_for_test.hpp"

namespace matterfit::mpm {
namespace {

using validation::bar_frequency;
using validation::box_body;
using validation::mean;
using validation::mean_where;

constexpr double kDx = 0.01;

Body bar(double length = 0.06) {
  Body body = box_body("bar", Vec3d::Zero(), Vec3d(length, 0.02, 0.02), 0.5 * kDx);
  body.formulation = Formulation::kTotal;
  body.material.youngs_modulus = 1e5;
  body.material.poisson_ratio = 0.0;
  return body;
}

Scene scene_with(Body body, double fps, int frames) {
  Scene scene;
  scene.dx = kDx;
  scene.fps = fps;
  scene.end_frame = frames + 1;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
  scene.bodies.push_back(std::move(body));
  return scene;
}

FrameState last_of(const Scene& scene) {
  FrameState last;
  validation::run(scene, 1, [&](const FrameState& state) {
    last = state;
    return true;
  });
  return last;
}

Pin plane_pin() {
  Pin pin;
  pin.region = Pin::Region::kPlane;
  pin.normal = Vec3d::UnitX();
  return pin;
}

/// c/4L whether the clamp lies on a boundary of cells (mirrored nodes) or anywhere else (point
/// constraints), wherever that is.
TEST(Pins, PlaneHoldsABarWhereverItLiesInTheCell) {
  for (const double offset : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9}) {
    const auto hz = bar_frequency({Formulation::kTotal, true, 2, offset, 1});
    EXPECT_NEAR(hz.measured / hz.expected, 1.0, 0.01) << "offset " << offset;
    EXPECT_LT(std::abs(hz.damping), 0.002) << "offset " << offset;
  }
}

/// Static stretch of a hanging bar, ρ g L²/(2E) at small strain. A smooth spline that is zero in
/// the box has no slope at its face either: the free length is a third of a cell short.
TEST(Pins, BoxHoldsWhatIsInIt) {
  Body body = bar(0.08);
  body.material.damping_shear = body.material.damping_bulk = 20.0;
  Pin pin;
  pin.region = Pin::Region::kBox;
  pin.low = Vec3d(-1, -1, -1);
  pin.high = Vec3d(0.02, 1, 1);  // leaves .06 m free
  body.pins.push_back(pin);
  Scene scene = scene_with(body, 20, 40);
  scene.gravity = shape::Keyed<Vec3d>(Vec3d(5, 0, 0));
  const FrameState state = last_of(scene);
  const Points& rest = scene.bodies[0].rest;
  const auto displacement = [&](double from, double to) {
    const auto in = [&](const Vec3d& x) { return x[0] > from && x[0] < to; };
    Vec3d before = Vec3d::Zero();
    double count = 0;
    for (const Vec3d& x : rest) {
      if (!in(x)) continue;
      before += x;
      count += 1;
    }
    return mean_where(state.bodies[0].positions, rest, in)[0] - before[0] / count;
  };
  EXPECT_LT(std::abs(displacement(0.0, 0.01)), 2e-6);
  const double free = 0.06;
  EXPECT_NEAR(displacement(0.075, 0.08), 1000 * 5 * free * free / (2 * 1e5), 0.12 * 9e-5);
}

/// A pin that is keyed drags the body along; slowly, as a rigid one.
TEST(Pins, KeyedMotionIsFollowed) {
  for (const double offset : {0.0, 0.4}) {
    Body body = bar();
    body.material.youngs_modulus = 1e6;
    Pin pin = plane_pin();
    pin.motion.times = {0.0, 0.5};
    pin.motion.values = {shape::Pose{}, shape::Pose{Vec3d(0.01, 0.02, -0.005), Quatd::Identity()}};
    body.pins.push_back(pin);
    Scene scene = scene_with(body, 50, 30);
    scene.grid_shift = Vec3d(offset, 0, 0);
    const FrameState state = last_of(scene);
    const Vec3d moved = mean_where(state.bodies[0].positions, body.rest,
                                   [](const Vec3d& x) { return x[0] < 0.005; }) -
                        Vec3d(0.0025, 0.01, 0.01);
    EXPECT_LT((moved - Vec3d(0.01, 0.02, -0.005)).norm(), 5e-4) << "offset " << offset;
  }
}

/// After its release a pin holds nothing: free fall from then on, to the exact height.
TEST(Pins, ReleaseIsAHalfKick) {
  Body body = bar();
  Pin pin;
  pin.region = Pin::Region::kAll;
  pin.release = 0.1;
  body.pins.push_back(pin);
  Scene scene = scene_with(body, 100, 30);
  scene.gravity = shape::Keyed<Vec3d>(Vec3d(0, 0, -9.81));
  const FrameState state = last_of(scene);
  EXPECT_NEAR(mean(state.bodies[0].positions)[2], 0.01 - 0.5 * 9.81 * 0.2 * 0.2, 2e-5);
  body.pins[0] = plane_pin();
  body.pins[0].release = 0.0;
  Scene other = scene_with(body, 100, 20);
  other.gravity = shape::Keyed<Vec3d>(Vec3d(0, 0, -9.81));
  EXPECT_NEAR(mean(last_of(other).bodies[0].positions)[2], 0.01 - 0.5 * 9.81 * 0.2 * 0.2, 2e-5);
}

TEST(Pins, AnUpdatedBodyRefusesAMassBesideIt) {
  Body body = bar();
  body.formulation = Formulation::kUpdated;
  body.masses.push_back({Vec3d(0.2, 0.01, 0.01), 0.1, 0.0});
  const Scene scene = scene_with(body, 100, 1);
  EXPECT_THROW(Simulation(scene, std::make_shared<Arena>(1)), Error);
}

TEST(Pins, APinBesideTheBodyIsRefused) {
  Body body = bar();
  Pin pin;
  pin.region = Pin::Region::kSphere;
  pin.point = Vec3d(1, 1, 1);
  pin.radius = 0.01;
  body.pins.push_back(pin);
  const Scene scene = scene_with(body, 100, 1);
  EXPECT_THROW(Simulation(scene, std::make_shared<Arena>(1)), Error);
}

/// Against the spring of stiffness EA/L that a bar is for a mass on its end.
struct HungMass {
  double frequency;  ///< over that with m and a third of the bar's mass
  double stretch;    ///< over (m + M/2) g L/(E A)
};

/// A mass m on the end of a light bar.
HungMass hung_mass(Formulation formulation) {
  Body body = bar();
  body.formulation = formulation;
  body.density = 200;
  body.pins.push_back(plane_pin());
  constexpr double kLength = 0.06;
  constexpr double kArea = 4e-4;
  const double own = body.density * kLength * kArea;
  const double mass = 4 * own;
  // Spread over the end face, so that it pulls evenly.
  for (const double y : {0.005, 0.015}) {
    for (const double z : {0.005, 0.015}) {
      body.masses.push_back({Vec3d(kLength, y, z), 0.25 * mass, 0.0});
    }
  }
  const double stiffness = 1e5 * kArea / kLength;
  const double expected = std::sqrt(stiffness / (mass + own / 3)) / (2 * std::numbers::pi);
  Scene scene = scene_with(body, 40 * expected, 120);
  constexpr double kPull = 4.0;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d(kPull, 0, 0));
  std::vector<double> times;
  std::vector<double> tip;
  validation::run(scene, 1, [&](const FrameState& state) {
    times.push_back(state.time);
    tip.push_back(mean_where(state.bodies[0].positions, body.rest,
                             [](const Vec3d& x) { return x[0] > 0.055; })[0]);
    return true;
  });
  const auto fit = validation::fit_sinusoid(times, tip, expected);
  const double stretch = (mass + 0.5 * own) * kPull / stiffness * (0.0575 / 0.06);
  return {fit.frequency / expected, (fit.centre - 0.0575) / stretch};
}

TEST(Pins, AttachedMassPullsAndSlows) {
  const HungMass total = hung_mass(Formulation::kTotal);
  // Point masses also move against the section around them: local compliance, 13 % here.
  EXPECT_NEAR(total.frequency, 1.0, 0.16);
  EXPECT_NEAR(total.stretch, 1.0, 0.03);
}

TEST(Pins, AttachedMassPullsAndSlowsAnUpdatedBody) {
  const HungMass updated = hung_mass(Formulation::kUpdated);
  // Heavy particles at the pin hold up to a cell more, a sixth of the bar's length, and the spring
  // is stiffer by that; the mass is what it is.
  EXPECT_NEAR(updated.stretch, 1.0, 0.2);
  EXPECT_NEAR(updated.frequency * updated.frequency * updated.stretch, 1.0, 0.08);
}

}  // namespace
}  // namespace matterfit::mpm
