// SPDX-License-Identifier: GPL-3.0-or-later
// What is easily right for a box and a short run, and wrong for other shapes and longer ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::mpm {
namespace {

/// Particles of a regular lattice at cells where `inside` says so, two a cell along each axis.
template <class Inside>
Body cells(double dx, const Vec3i& counts, const Inside& inside) {
  Body body;
  body.name = "body";
  body.lattice.spacing = 0.5 * dx;
  body.lattice.regular = true;
  for (int i = 0; i < 2 * counts[0]; ++i)
    for (int j = 0; j < 2 * counts[1]; ++j)
      for (int k = 0; k < 2 * counts[2]; ++k) {
        if (!inside(Vec3i(i / 2, j / 2, k / 2))) continue;
        body.rest.emplace_back(0.5 * dx * Vec3d(i + 0.5, j + 0.5, k + 0.5));
        body.volumes.push_back(dx * dx * dx / 8.0);
      }
  return body;
}
bool everywhere(const Vec3i&) { return true; }

Scene scene_of(Body body, double dx, double fps, int frames) {
  Scene scene;
  scene.dx = dx;
  scene.fps = fps;
  scene.end_frame = frames + 1;
  scene.bodies.push_back(std::move(body));
  return scene;
}

/// Runs all frames and returns the last report.
FrameReport run(Simulation& simulation) {
  const Interrupter interrupter;
  FrameReport report;
  while (simulation.frame() + 1 < simulation.scene().end_frame) {
    report = simulation.advance(interrupter);
  }
  return report;
}

TEST(SimulationLimits, MasslessNodesMayFallAsFarAsTheyLike) {
  // An L: the second block has particles in its last column of cells only, so the nodes in its
  // middle carry nothing. The body is clamped and comes to rest; those nodes fall for three
  // seconds.
  const double dx = 0.01;
  Body body = cells(dx, {4, 8, 2}, [](const Vec3i& c) { return c[1] < 4 || c[0] == 3; });
  body.material.youngs_modulus = 1e6;
  body.material.damping_shear = 100.0;
  Pin pin;
  pin.region = Pin::Region::kPlane;
  pin.normal = Vec3d::UnitY();
  body.pins.push_back(pin);
  Simulation simulation(scene_of(std::move(body), dx, 10, 30), std::make_shared<Arena>(1));
  const FrameReport report = run(simulation);
  EXPECT_LT(report.kinetic_energy, 2e-10);
  double largest = 0.0;
  const FrameState state = simulation.state();
  for (const Mat3f& f : state.bodies[0].deformation_gradients) {
    largest = std::max(largest, static_cast<double>((f - Mat3f::Identity()).norm()));
  }
  EXPECT_GT(largest, 1e-4);  // it sags
  EXPECT_LT(largest, 2e-2);
}

TEST(SimulationLimits, MassesAtOnePlaceAddUp) {
  const double dx = 0.01;
  const auto drop_of = [&](const std::vector<double>& masses) {
    Body body = cells(dx, {2, 8, 2}, everywhere);
    body.material.youngs_modulus = 1e6;
    Pin pin;
    pin.region = Pin::Region::kPlane;
    pin.normal = Vec3d::UnitY();
    body.pins.push_back(pin);
    for (const double m : masses) body.masses.push_back({Vec3d(0.01, 0.07, 0.01), m, 0.0});
    Simulation simulation(scene_of(std::move(body), dx, 100, 5), std::make_shared<Arena>(1));
    run(simulation);
    double lowest = 1.0;
    const FrameState state = simulation.state();
    for (const Vec3f& x : state.bodies[0].positions) {
      lowest = std::min(lowest, static_cast<double>(x[2]));
    }
    return lowest;
  };
  // The body weighs 32 g.
  const double one = drop_of({0.2});
  EXPECT_NEAR(drop_of({0.05, 0.1, 0.05}), one, 1e-6);
  EXPECT_GT(std::abs(drop_of({0.1}) - one), 1e-4);
}

TEST(SimulationLimits, LetGoWithinAFrame) {
  const double dx = 0.01;
  Body body = cells(dx, {3, 3, 3}, everywhere);
  Pin pin;
  pin.release = 0.05;
  body.pins.push_back(pin);
  Simulation simulation(scene_of(std::move(body), dx, 10, 1), std::make_shared<Arena>(1));
  const FrameReport report = run(simulation);
  EXPECT_GT(report.substeps, 50);
  const BodyState state = simulation.state().bodies[0];
  const Points& rest = simulation.scene().bodies[0].rest;
  for (std::size_t p = 0; p < rest.size(); ++p) {
    const double fallen = rest[p][2] - static_cast<double>(state.positions[p][2]);
    EXPECT_NEAR(fallen, 0.5 * 9.81 * 0.05 * 0.05, 9.81 * 0.05 * report.dt);
  }
}

TEST(SimulationLimits, SlidingIntoNewBlocksKeepsTouching) {
  // The penetration of a body that slides at speed over the edges of blocks is that of one at rest.
  const double dx = 0.01;
  const auto deepest = [&](double speed) {
    Body body = cells(dx, {6, 4, 4}, everywhere);
    body.formulation = Formulation::kUpdated;
    body.material.youngs_modulus = 3e4;
    body.material.damping_shear = 2.0;
    body.velocity = Vec3d(speed, 0, 0);
    Scene scene = scene_of(std::move(body), dx, 50, 20);
    shape::Contact contact;
    contact.kind = shape::ContactKind::kSeparating;
    scene.colliders.push_back(shape::make_plane("floor", contact, Vec3d::Zero(), Vec3d::UnitZ()));
    Simulation simulation(std::move(scene), std::make_shared<Arena>(1));
    const Interrupter interrupter;
    double most = 0.0;
    for (int k = 0; k < 20; ++k) {
      most = std::max(most, simulation.advance(interrupter).max_penetration);
    }
    return most;
  };
  const double at_rest = deepest(0.0);
  EXPECT_GT(at_rest, 0.0);
  EXPECT_LT(deepest(1.5), 1.3 * at_rest);
}

// Particles .005 m apart; those of a layer at the surface lie .0025 m inside it.
TEST(SimulationLimits, ABodyMayStartInAColliderByAFractionOfAParticle) {
  const auto start = [](double depth) {
    Scene scene = scene_of(cells(0.01, {4, 4, 4}, everywhere), 0.01, 50, 1);
    scene.colliders.push_back(
        shape::make_plane("floor", {}, Vec3d(0.0, 0.0, depth), Vec3d::UnitZ()));
    (void)Simulation(std::move(scene), std::make_shared<Arena>(1));
  };
  EXPECT_NO_THROW(start(0.0));
  EXPECT_NO_THROW(start(0.004));
  EXPECT_THAT([&] { start(0.005); }, testing::ThrowsMessage<Error>(testing::HasSubstr(
                                         "Body 'body' starts up to 0.005 m inside 'floor'")));
  EXPECT_THAT([&] { start(0.012); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("up to 0.012 m inside 'floor'")));
}

// What the run is stopped with names the particle, without coordinates where they are no numbers.
TEST(SimulationLimits, WhatIsNotANumberIsSaidInWords) {
  for (const Formulation formulation : {Formulation::kTotal, Formulation::kUpdated}) {
    Body body = cells(0.01, {4, 4, 4}, everywhere);
    body.formulation = formulation;
    Scene scene = scene_of(std::move(body), 0.01, 50, 5);
    scene.dt = 1.0 / 50;
    scene.gravity = shape::Keyed<Vec3d>(Vec3d(0, 0, -1e300));
    Simulation simulation(std::move(scene), std::make_shared<Arena>(1));
    std::string said;
    try {
      (void)run(simulation);
    } catch (const Error& error) {
      said = error.what();
    }
    EXPECT_THAT(said, testing::ContainsRegex("particle [0-9]+ is not a number"));
    EXPECT_THAT(said, testing::Not(testing::HasSubstr("nan")));
  }
}

}  // namespace
}  // namespace matterfit::mpm
