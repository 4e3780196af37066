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

namespace matterfit::mpm {

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
  for (int axis = 0; axis < 3; ++axis) {
    const std::string name(1, "xyz"[axis]);
    expect_slope(run, g.schedule, "offset " + name, g.bodies[0].offset[axis], 1e-4,
                 [axis](TermCase& c, double by) { c.offset[axis] += by; });
    expect_slope(run, g.schedule, "turn " + name, g.bodies[0].rotation[axis], 1e-4,
                 [axis](TermCase& c, double by) { c.turn[axis] += by; });
    expect_slope(run, g.schedule, "velocity " + name, g.bodies[0].velocity[axis], 1e-3,
                 [axis](TermCase& c, double by) { c.velocity[axis] += by; });
    expect_slope(run, g.schedule, "spin " + name, g.bodies[0].spin[axis], 1e-2,
                 [axis](TermCase& c, double by) { c.spin[axis] += by; });
    expect_slope(run, g.schedule, "gravity " + name, g.gravity[axis], 1e-2,
                 [axis](TermCase& c, double by) { c.gravity[axis] += by; });
  }
}

}  // namespace matterfit::mpm
