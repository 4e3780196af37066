// SPDX-License-Identifier: GPL-3.0-or-later
// Runs with effects whose derivatives are checked against fourth-order differences of whole runs.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "effects/effect_type.hpp"
#include "mpm/gradient_runs_for_test.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::mpm {

inline void set(effects::Effect& effect, const std::string& key, const Vec3d& value) {
  const auto i = effect.type->find(key);
  ASSERT_TRUE(i.has_value()) << key;
  for (std::size_t c = 0; c < effect.type->parameters[*i].size; ++c) {
    effect.values[effect.type->offset(*i) + c] = value[static_cast<int>(c)];
  }
}
inline void set(effects::Effect& effect, const std::string& key, double value) {
  set(effect, key, Vec3d::Constant(value));
}

/// A ball of 0.1 m that is thrown, without gravity or anything that it could touch.
inline Scene ball(Formulation formulation, const Vec3d& velocity) {
  Scene scene;
  scene.fps = 50.0;
  scene.end_frame = 26;
  scene.dx = 0.05;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
  Body body;
  body.name = "ball";
  body.density = 50.0;
  body.formulation = formulation;
  body.material.law = material::Law::kNeoHookean;
  body.material.youngs_modulus = 1e5;
  body.material.poisson_ratio = 0.3;
  body.velocity = velocity;
  body.lattice.regular = true;
  body.lattice.spacing = 0.5 * scene.dx;
  const double h = body.lattice.spacing;
  for (int i = -4; i < 4; ++i)
    for (int j = -4; j < 4; ++j)
      for (int k = -4; k < 4; ++k) {
        const Vec3d x = h * Vec3d(i + 0.5, j + 0.5, k + 0.5);
        if (x.norm() > 0.1) continue;
        body.rest.push_back(x);
        body.volumes.push_back(h * h * h);
      }
  scene.bodies.push_back(std::move(body));
  return scene;
}

inline FrameState last_state(const Scene& scene, int threads = 1) {
  Simulation simulation(scene, std::make_shared<Arena>(threads), {});
  while (simulation.frame() + 1 < scene.end_frame) (void)simulation.advance(Interrupter());
  return simulation.state();
}

struct TermCase : GradientCase {
  std::vector<effects::Effect> with;

  TermCase(Formulation of, std::vector<effects::Effect> some) : with(std::move(some)) {
    formulation = of;
    frames = 3;
  }
  [[nodiscard]] Scene scene() const {
    Scene scene = GradientCase::scene();
    scene.effects = with;
    return scene;
  }
  template <class S>
  [[nodiscard]] Gradient gradient(GradientOptions options = {}, int threads = 1) const {
    return mpm::gradient<S>(scene(), std::make_shared<Arena>(threads), observe, options,
                            Interrupter());
  }
  [[nodiscard]] double loss(const Schedule& schedule) const {
    GradientOptions options;
    options.schedule = schedule;
    return roll_out<double>(scene(), std::make_shared<Arena>(1), observe, options, Interrupter())
        .loss;
  }
};

/// `found` against the fourth-order difference when `move` adds to the case, 1e-6 of it or of 1.
inline void expect_slope(const TermCase& run, const Schedule& schedule, const std::string& what,
                         double found, double step,
                         const std::function<void(TermCase&, double)>& move) {
  const auto at = [&](double by) {
    TermCase moved = run;
    move(moved, by);
    return moved.loss(schedule);
  };
  const double difference =
      (8.0 * (at(step) - at(-step)) - (at(2.0 * step) - at(-2.0 * step))) / (12.0 * step);
  EXPECT_NEAR(found, difference, 1e-6 * std::max(std::abs(difference), 1.0)) << what;
}

/// By every number of its effects, and by what they change of the others.
inline void expect_gradient(const TermCase& run) {
  const Gradient g = run.gradient<double>();
  ASSERT_EQ(g.effects.size(), run.with.size());
  for (std::size_t e = 0; e < run.with.size(); ++e) {
    const effects::Effect& effect = run.with[e];
    for (std::size_t k = 0; k < effect.values.size(); ++k) {
      const double size = std::max(std::abs(effect.values[k]), 0.02);
      expect_slope(run, g.schedule, effect.name + " " + std::to_string(k), g.effects[e][k],
                   2e-3 * size, [e, k](TermCase& c, double by) { c.with[e].values[k] += by; });
    }
  }
  expect_slope(run, g.schedule, "density", g.bodies[0].density, 1.0,
               [](TermCase& c, double by) { c.density += by; });
  expect_slope(run, g.schedule, "E", g.bodies[0].material.youngs_modulus, 200.0,
               [](TermCase& c, double by) { c.material.youngs_modulus += by; });
  // Small steps: where a particle goes from one cell to the next within them, the slope of a
  // quadratic spline has a kink, and so has the force of a stress.
  for (int axis = 0; axis < 3; ++axis) {
    const std::string name(1, "xyz"[axis]);
    expect_slope(run, g.schedule, "offset " + name, g.bodies[0].offset[axis], 1e-5,
                 [axis](TermCase& c, double by) { c.offset[axis] += by; });
    expect_slope(run, g.schedule, "turn " + name, g.bodies[0].rotation[axis], 1e-5,
                 [axis](TermCase& c, double by) { c.turn[axis] += by; });
    expect_slope(run, g.schedule, "velocity " + name, g.bodies[0].velocity[axis], 1e-4,
                 [axis](TermCase& c, double by) { c.velocity[axis] += by; });
    expect_slope(run, g.schedule, "spin " + name, g.bodies[0].spin[axis], 1e-2,
                 [axis](TermCase& c, double by) { c.spin[axis] += by; });
    expect_slope(run, g.schedule, "gravity " + name, g.gravity[axis], 1e-2,
                 [axis](TermCase& c, double by) { c.gravity[axis] += by; });
  }
}

}  // namespace matterfit::mpm
