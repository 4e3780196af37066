// SPDX-License-Identifier: GPL-3.0-or-later
// What a gradient must not depend on, and how it refuses.
#include "mpm/gradient_record.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "base/error.hpp"
#include "mpm/gradient_runs_for_test.hpp"

namespace matterfit::mpm {
namespace {

using testing::HasSubstr;

/// Contact, history of both kinds and a pin that lets go.
GradientCase everything(Formulation formulation = Formulation::kTotal) {
  GradientCase run;
  run.formulation = formulation;
  run.fps = 50.0;
  run.ground = true;
  if (formulation != Formulation::kRenewed) run.hold = GradientCase::Hold::kPatch;
  run.release = 0.013;
  run.masses = formulation == Formulation::kTotal;
  run.neighbour = !run.masses;
  run.material.law = material::Law::kVonMises;
  run.material.yield_stress = 800.0;
  run.material.hardening = 1e4;
  run.material.maxwell = {{5e4, 2e-3}};
  return run;
}

/// All numbers of a gradient, in order.
std::vector<double> numbers(const Gradient& g) {
  std::vector<double> all{g.loss};
  const auto add = [&](const Vec3d& v) { all.insert(all.end(), v.begin(), v.end()); };
  for (const BodyGradient& b : g.bodies) {
    const material::MaterialGradient& m = b.material;
    all.insert(all.end(), {m.youngs_modulus, m.poisson_ratio, m.yield_stress, m.hardening,
                           m.damping_shear, m.damping_bulk, b.density});
    for (const material::MaxwellBranch& branch : m.maxwell) {
      all.insert(all.end(), {branch.modulus, branch.time});
    }
    add(b.offset);
    add(b.rotation);
    add(b.velocity);
    add(b.spin);
    for (const Vec3d& v : b.particle_velocities) add(v);
  }
  for (const ColliderGradient& c : g.colliders) {
    all.insert(all.end(), {c.mu, c.stiffness, c.damping});
    add(c.translation);
    add(c.rotation);
  }
  add(g.gravity);
  return all;
}

bool same_bits(const Gradient& a, const Gradient& b) {
  const std::vector<double> x = numbers(a);
  const std::vector<double> y = numbers(b);
  return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0;
}

TEST(GradientRecord, EveryBudgetGivesTheSameBits) {
  const GradientCase run = everything();
  const Gradient whole = run.gradient<float>();
  ASSERT_GT(whole.substeps, 30U);
  EXPECT_EQ(whole.recomputed, 0U);
  GradientOptions options;
  options.memory_budget = whole.peak_bytes;
  std::size_t last = 0;
  // To the budget that it names as the least, and no further.
  for (int k = 0; k < 20; ++k) {
    const Gradient g = run.gradient<float>(options);
    EXPECT_TRUE(same_bits(g, whole)) << options.memory_budget;
    EXPECT_LE(g.peak_bytes, options.memory_budget);
    EXPECT_GE(g.recomputed, last);
    last = g.recomputed;
    options.memory_budget = options.memory_budget * 4 / 5;
    if (options.memory_budget < 16 * whole.state_bytes) break;
  }
  EXPECT_GT(last, whole.substeps / 2);
  EXPECT_LT(last, whole.substeps);
}

TEST(GradientRecord, EveryBudgetGivesTheSameBitsOfUpdatedBodies) {
  GradientCase run = everything(Formulation::kUpdated);
  run.substeps = 40;
  run.frames = 5;
  const Gradient whole = run.gradient<float>();
  ASSERT_EQ(whole.substeps, 160U);
  EXPECT_EQ(whole.recomputed, 0U);
  GradientOptions options;
  options.memory_budget = whole.peak_bytes;
  EXPECT_EQ(run.gradient<float>(options).recomputed, 0U);
  for (int k = 0; k < 3; ++k) {
    options.memory_budget = options.memory_budget * 3 / 5;
    const Gradient g = run.gradient<float>(options);
    EXPECT_TRUE(same_bits(g, whole)) << options.memory_budget;
    EXPECT_LE(g.peak_bytes, options.memory_budget);
    EXPECT_EQ(g.recomputed, g.substeps);
  }
  options.memory_budget = 4 * whole.state_bytes;
  EXPECT_THROW((void)run.gradient<float>(options), Error);
}

TEST(GradientRecord, EveryBudgetGivesTheSameBitsOfRenewedBodies) {
  const GradientCase run = everything(Formulation::kRenewed);
  const Gradient whole = run.gradient<float>();
  ASSERT_GT(whole.substeps, 30U);
  // The last substeps before renewals, and no others.
  EXPECT_GT(whole.recomputed, 0U);
  EXPECT_LT(whole.recomputed, whole.substeps / 4);
  GradientOptions options;
  for (const std::size_t states : {60U, 25U}) {
    options.memory_budget = states * whole.state_bytes;
    const Gradient g = run.gradient<float>(options);
    EXPECT_TRUE(same_bits(g, whole)) << states;
    EXPECT_LE(g.peak_bytes, options.memory_budget);
    EXPECT_GT(g.recomputed, whole.recomputed);
  }
}

TEST(GradientRecord, ABudgetThatIsTooSmallSaysWhatIsNeeded) {
  const GradientCase run = everything();
  GradientOptions options;
  options.memory_budget = 1 << 18U;
  try {
    (void)run.gradient<float>(options);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    const std::string text = error.what();
    EXPECT_THAT(text, HasSubstr("memory budget of 0.25 MB cannot hold this run"));
    const auto at = text.find(" MB at least");
    ASSERT_NE(at, std::string::npos) << text;
    const double needed = std::stod(text.substr(text.rfind(' ', at - 1)));
    // The run's length and its contact were not known yet.
    options.memory_budget = static_cast<std::size_t>(1.2 * needed * 1024.0 * 1024.0);
  }
  EXPECT_TRUE(same_bits(run.gradient<float>(options), run.gradient<float>()));
}

TEST(GradientRecord, SegmentsGrowOnlyAsTheyMust) {
  for (const std::size_t budget : {40U, 20U, 15U, 12U}) {
    GradientRecord<int> record(budget);
    std::size_t taken = 0;
    for (std::size_t n = 0; n < 36; ++n) {
      if (record.wants(n)) record.put(n, static_cast<int>(n), 1, 36);
      EXPECT_LE(record.peak(), budget);
    }
    std::size_t end = 36;
    while (!record.empty()) {
      const auto [begin, state] = record.take_last();
      EXPECT_EQ(static_cast<std::size_t>(state), begin);
      EXPECT_LE(end - begin, record.interval());
      taken += end - begin;
      end = begin;
    }
    EXPECT_EQ(taken, 36U);
    EXPECT_EQ(record.interval(), budget == 40 ? 1U : budget == 20 ? 2U : 4U);
  }
  EXPECT_EQ(least_record(36, 1, 5), 5U + 12U);
}

TEST(GradientRecord, ARollOutKeepsNothingForAWayBack) {
  GradientCase run = everything();
  GradientOptions options;
  options.memory_budget = 1;
  const auto roll = [&](const GradientOptions& with) {
    return roll_out<float>(run.scene(), std::make_shared<Arena>(1), GradientCase::observe, with,
                           Interrupter())
        .loss;
  };
  EXPECT_EQ(roll(options), roll({}));
}

TEST(GradientRecord, AScheduleOfAnotherSceneIsRefused) {
  const GradientCase run = everything();
  for (const Schedule& schedule : {Schedule{{0, {0.0}}}, Schedule{{5, {}}}}) {
    GradientOptions options;
    options.schedule = schedule;
    EXPECT_THROW((void)run.gradient<float>(options), Error);
  }
}

class GradientOf : public testing::TestWithParam<Formulation> {};

TEST_P(GradientOf, ThreadsDoNotMatter) {
  GradientCase run = everything(GetParam());
  run.length = 14;  // several blocks of the grid
  run.frames = 3;
  const Gradient one = run.gradient<float>({}, 1);
  EXPECT_TRUE(same_bits(one, run.gradient<float>({}, 2)));
  EXPECT_TRUE(same_bits(one, run.gradient<float>({}, 4)));
}

TEST_P(GradientOf, FloatsAgreeWithDouble) {
  const GradientCase run = everything(GetParam());
  const Gradient exact = run.gradient<double>();
  GradientOptions options;
  options.schedule = exact.schedule;
  const Gradient found = run.gradient<float>(options);
  EXPECT_NEAR(found.loss, exact.loss, 1e-5 * exact.loss);
  const auto expect = [&](double a, double b, double unit, const char* name) {
    EXPECT_NEAR(unit * a, unit * b, 2e-3 * std::max(std::abs(unit * b), 1.0)) << name;
  };
  const BodyGradient& a = found.bodies[0];
  const BodyGradient& b = exact.bodies[0];
  expect(a.material.youngs_modulus, b.material.youngs_modulus, 2e5, "E");
  expect(a.material.yield_stress, b.material.yield_stress, 800.0, "yield");
  expect(a.material.maxwell[0].modulus, b.material.maxwell[0].modulus, 5e4, "modulus");
  expect(a.density, b.density, 900.0, "density");
  expect(found.colliders[0].mu, exact.colliders[0].mu, 0.3, "mu");
  for (int axis = 0; axis < 3; ++axis) {
    expect(a.velocity[axis], b.velocity[axis], 1.0, "velocity");
    expect(a.offset[axis], b.offset[axis], 0.1, "offset");
    expect(a.spin[axis], b.spin[axis], 5.0, "spin");
  }
}

TEST_P(GradientOf, TheForwardPassHasTheBitsOfSimulation) {
  const Scene scene = everything(GetParam()).scene();
  const auto arena = std::make_shared<Arena>(1);
  const Interrupter interrupter;
  Simulation simulation(scene, arena);
  Schedule schedule;
  const Observer compare = [&](const ObservedFrame& frame, FrameLoss&) {
    if (frame.frame > scene.first_frame) {
      schedule.push_back({simulation.advance(interrupter).substeps, {}});
    }
    const FrameState state = simulation.state();
    EXPECT_EQ(state.frame, frame.frame);
    EXPECT_EQ(state.time, frame.time);
    for (std::size_t p = 0; p < frame.bodies[0].positions.size(); ++p) {
      EXPECT_EQ(state.bodies[0].positions[p], frame.bodies[0].positions[p].cast<float>());
      EXPECT_EQ(state.bodies[0].velocities[p], frame.bodies[0].velocities[p].cast<float>());
    }
  };
  const Gradient g = gradient<float>(scene, arena, compare, {}, interrupter);
  ASSERT_EQ(schedule.size(), g.schedule.size());
  for (std::size_t f = 0; f < schedule.size(); ++f) {
    EXPECT_EQ(schedule[f].substeps, g.schedule[f].substeps);
  }
}

INSTANTIATE_TEST_SUITE_P(Formulations, GradientOf,
                         testing::Values(Formulation::kTotal, Formulation::kUpdated,
                                         Formulation::kRenewed),
                         [](const auto& info) {
                           return info.param == Formulation::kTotal     ? "total"
                                  : info.param == Formulation::kUpdated ? "updated"
                                                                        : "renewed";
                         });

TEST(GradientRecord, ProgressRisesAndCancelStopsBothWays) {
  const GradientCase run = everything();
  std::vector<double> shares;
  GradientOptions options;
  options.progress = [&](double share) { shares.push_back(share); };
  (void)run.gradient<float>(options);
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_EQ(shares.back(), 1.0);
  for (const double at : {0.1, 0.8}) {
    Interrupter interrupter;
    options.progress = [&](double share) {
      if (share > at) interrupter.cancel();
    };
    EXPECT_THROW((void)gradient<float>(run.scene(), std::make_shared<Arena>(1),
                                       GradientCase::observe, options, interrupter),
                 Error);
  }
}

TEST(GradientRecord, WhatHasNoAdjointIsRefusedByName) {
  const auto error_of = [](const Scene& scene, const Observer& observer) -> std::string {
    try {
      (void)gradient<float>(scene, std::make_shared<Arena>(1), observer, {}, Interrupter());
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      return error.what();
    }
    return "";
  };
  Scene scene = GradientCase().scene();
  scene.bodies.push_back(scene.bodies[0]);
  scene.bodies[1].name = "other";
  EXPECT_THAT(error_of(scene, GradientCase::observe),
              HasSubstr("Bodies 'bar' and 'other' may touch each other"));
  scene.bodies[0].formulation = Formulation::kUpdated;
  EXPECT_THAT(error_of(scene, GradientCase::observe), HasSubstr("Bodies 'other' and 'bar'"));
  scene.bodies[0].formulation = Formulation::kTotal;
  scene.bodies.resize(1);
  EXPECT_THAT(
      error_of(scene, [](const ObservedFrame&,
                         FrameLoss& loss) { loss.bodies[0].velocities.resize(5, Vec3d::Zero()); }),
      HasSubstr("frame 3 has 5 derivatives for the 96 particles of body 'bar'"));
}

}  // namespace
}  // namespace matterfit::mpm
