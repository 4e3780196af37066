// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/predictor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <thread>

#include "base/error.hpp"
#include "fit/data/capture_marks.hpp"

namespace matterfit::fit {
namespace {

using mpm::Formulation;
using testing::HasSubstr;

constexpr double kH = 0.05;             // particle separation at level 1 [m]
constexpr double kPredictorFps = 50.0;  // of scene and capture
constexpr double kFar = 3.0;            // of the cube from the origin, where float has 2e-7 m

/// A cube thrown at a level ground, of four particles a side at level 1, two at level 2.
mpm::Scene cube(double level, Formulation formulation) {
  const double h = kH * level;
  mpm::Scene scene;
  scene.fps = kPredictorFps;
  scene.first_frame = 10;
  scene.end_frame = 16;
  scene.dx = 2.0 * h;
  mpm::Body body;
  body.name = "cube";
  body.formulation = formulation;
  body.material.youngs_modulus = 5e4;
  body.velocity = Vec3d(1.0, 0.5, -2.0);
  body.lattice.spacing = h;
  body.lattice.regular = true;
  body.lattice.origin = Vec3d(kFar, 0.0, 0.02);
  const int side = static_cast<int>(std::lround(4.0 / level));
  for (int i = 0; i < side; ++i) {
    for (int j = 0; j < side; ++j) {
      for (int k = 0; k < side; ++k) {
        body.rest.push_back(body.lattice.origin + h * Vec3d(i + 0.5, j + 0.5, k + 0.5));
        body.volumes.push_back(h * h * h);
      }
    }
  }
  scene.bodies.push_back(std::move(body));
  shape::Contact contact;
  contact.stiffness = 1e6;
  scene.colliders.push_back(shape::make_plane("ground", contact, Vec3d::Zero(), Vec3d::UnitZ()));
  return scene;
}

/// Two points of the cube over eight frames, of which the scene has six; the last two frames of
/// them are held out.
Experiment experiment(Formulation formulation = Formulation::kAuto) {
  Run run;
  run.build = [formulation](double level, Arena&, const Interrupter&) {
    return cube(level, formulation);
  };
  run.clock = {kPredictorFps, 10, 16};
  Capture capture;
  CaptureInput& input = capture.input;
  input.name = "a";
  input.body = "cube";
  input.rest = {Vec3d(kFar + 0.04, 0.06, 0.11), Vec3d(kFar + 0.17, 0.15, 0.05)};
  input.rest_samples = {1, 1};
  input.held_out_points = {0, 0};
  input.tracks.points = 2;
  for (std::size_t t = 0; t < 8; ++t) {
    input.tracks.times.push_back(double(t) / kPredictorFps);
    input.tracks.positions.insert(input.tracks.positions.end(), input.rest.begin(),
                                  input.rest.end());
    input.held_out_frames.push_back(t == 4 || t == 5 ? 1 : 0);
  }
  capture.viewing.start_frame = 10.0;
  capture.sigma = {1e-3, 1e-3};
  mark_used(capture, run.clock);
  run.fitted = true;
  run.captures.push_back(std::move(capture));
  Experiment all;
  all.runs.push_back(std::move(run));
  return all;
}

Address address(Owner owner, const char* path, const char* name) {
  Address at;
  at.quantity = &row_named(owner, path);
  at.owner = name;
  return at;
}

std::vector<ParameterSpec> youngs_modulus() {
  ParameterSpec spec;
  spec.path = address(Owner::kBody, "material.E", "cube");
  return {spec};
}

const SimulatedCapture& seen(const Evaluation& evaluation, std::size_t ask = 0) {
  return evaluation.outcomes.at(ask).value().at(0).captures.at(0);
}

/// To the last bit, samples outside the simulated time (NaN) included.
std::vector<std::uint64_t> bits_of(const SimulatedCapture& capture) {
  std::vector<std::uint64_t> bits;
  bits.reserve(3 * capture.positions.size());
  for (const Vec3d& x : capture.positions) {
    for (int a = 0; a < 3; ++a) bits.push_back(std::bit_cast<std::uint64_t>(x[a]));
  }
  return bits;
}

double largest_change(const SimulatedCapture& a, const SimulatedCapture& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.positions.size(); ++i) {
    if (!a.positions[i].allFinite()) continue;
    largest = std::max(largest, (a.positions[i] - b.positions[i]).norm());
  }
  return largest;
}

Ask ask(std::vector<double> values = {}) {
  Ask one;
  one.query.values = std::move(values);
  return one;
}

TEST(Predictor, SeesAllSamplesWithoutRounding) {
  const Experiment of = experiment();
  const Interrupter interrupter;
  Predictor predictor(of, {}, {}, interrupter);
  const Evaluation found = predictor.predict({ask()}, true);
  const SimulatedCapture& at = seen(found);
  ASSERT_EQ(at.positions.size(), 16U);
  ASSERT_EQ(at.velocities.size(), 16U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT((at.positions[i] - of.runs[0].captures[0].input.rest[i]).norm(), 1e-9);
    EXPECT_LT((at.velocities[i] - Vec3d(1.0, 0.5, -2.0)).norm(), 1e-5);
    EXPECT_TRUE(at.positions[2 * 4 + i].allFinite());   // held out
    EXPECT_FALSE(at.positions[2 * 7 + i].allFinite());  // after the scene's end
  }
}

TEST(Predictor, SetsAnyQuantityAlsoOneThatIsNotFitted) {
  const Experiment of = experiment();
  const Interrupter interrupter;
  Predictor fitted(of, youngs_modulus(), {}, interrupter);
  Predictor plain(of, {}, {}, interrupter);
  Ask soft = ask();
  soft.query.variation.set = {{address(Owner::kBody, "material.E", "cube"), 2e4}};
  const Evaluation as_parameter = fitted.predict({ask({2e4}), ask({5e4})});
  const Evaluation as_variation = plain.predict({soft, ask()});
  EXPECT_EQ(bits_of(seen(as_parameter, 0)), bits_of(seen(as_variation, 0)));
  EXPECT_EQ(bits_of(seen(as_parameter, 1)), bits_of(seen(as_variation, 1)));
  EXPECT_GT(largest_change(seen(as_parameter, 0), seen(as_parameter, 1)), 1e-4);
  // A variation comes after the parameters.
  Ask both = ask({5e4});
  both.query.variation = soft.query.variation;
  EXPECT_EQ(bits_of(seen(fitted.predict({both}))), bits_of(seen(as_variation, 0)));

  Ask sideways = ask();
  Address velocity = address(Owner::kBody, "velocity", "cube");
  velocity.component = 1;
  sideways.query.variation.set = {{velocity, 3.5},
                                  {address(Owner::kCapture, "start_frame", "a"), 11}};
  const Evaluation moved = plain.predict({sideways});
  // Looked at a frame later, when it has flown for a fiftieth of a second.
  EXPECT_NEAR(seen(moved).positions[0].y(), 0.06 + 3.5 / kPredictorFps, 1e-3);
  Ask shifted = ask();
  Address place = address(Owner::kBody, "placement.position", "cube");
  place.component = 1;
  shifted.query.variation.set = {{place, 0.01}};
  EXPECT_LT(largest_change(seen(plain.predict({shifted})), seen(as_variation, 1)), 0.02)
      << "points that rest in the world are bound to the body where it is placed";
}

TEST(Predictor, SaysWhatItCannotSet) {
  const Experiment of = experiment();
  const Interrupter interrupter;
  Predictor predictor(of, {}, {}, interrupter);
  Ask wrong = ask();
  wrong.query.variation.set = {{address(Owner::kBody, "material.yield_stress", "cube"), 1e3}};
  Evaluation found = predictor.predict({wrong});
  EXPECT_FALSE(found.outcomes[0]);
  EXPECT_TRUE(found.failure.by_input);
  EXPECT_THAT(found.failure.message, HasSubstr("bodies.cube.material.yield_stress"));
  Ask longer = ask();
  longer.query.variation.dt_factor = 1.5;
  found = predictor.predict({longer, ask()});
  EXPECT_FALSE(found.outcomes[0]);
  EXPECT_TRUE(found.outcomes[1]);
  EXPECT_THAT(found.failure.message, HasSubstr("1.5"));
  EXPECT_THROW((void)predictor.model(0.5), Error);
}

TEST(Predictor, VariesGridStepAndResolution) {
  for (const Formulation formulation : {Formulation::kTotal, Formulation::kUpdated}) {
    const Experiment of = experiment(formulation);
    const Interrupter interrupter;
    Predictor predictor(of, {}, {}, interrupter);
    Ask finer = ask();
    finer.query.variation.dt_factor = 0.5;
    Ask offset = ask();
    offset.query.variation.grid_shift = Vec3d(0.3, 0.2, 0.4);
    Ask coarse = ask();
    coarse.level = 2.0;
    const Evaluation found = predictor.predict({ask(), finer, offset, coarse});
    const SimulatedCapture& plain = seen(found);
    for (std::size_t k = 1; k < 4; ++k) {
      const double change = largest_change(plain, seen(found, k));
      EXPECT_GT(change, 1e-7) << k;
      EXPECT_LT(change, 0.05) << k;  // a cube of one or two cells that lands
      EXPECT_LT((seen(found, k).positions[0] - plain.positions[0]).norm(), 1e-6) << k;
    }
    const int steps = found.outcomes[0].value()[0].substeps[0];
    EXPECT_NEAR(found.outcomes[1].value()[0].substeps[0], 2 * steps, 1);
  }
}

TEST(Model, TakesPlansAsArgumentsFromAnyThread) {
  const Experiment of = experiment();
  const Interrupter interrupter;
  Predictor predictor(of, youngs_modulus(), {}, interrupter);
  const Model& model = predictor.model();
  const std::vector<std::vector<double>> soft{{5e4}};
  const std::vector<std::vector<double>> stiff{{9e4}};
  Scope scope = whole_scope(of.runs);
  const Evaluation chosen = model.evaluate(soft, scope);
  StepPlan plan = model.plan_of(soft.front(), *chosen.outcomes.front());
  EXPECT_EQ(plan.runs[0].substeps, with_neighbours(chosen.outcomes.front().value()[0].substeps));
  EXPECT_EQ(with_neighbours({3, 3, 9, 4, 3, 3}), (std::vector<int>{3, 9, 9, 9, 4, 3}));
  // Held: within the margin stiffer values take the same steps; beyond it a quarter octave more.
  scope.plan = &plan;
  const Evaluation held = model.evaluate(std::vector<std::vector<double>>{{5.5e4}}, scope);
  EXPECT_EQ(held.outcomes.front().value()[0].substeps, plan.runs[0].substeps);
  StepPlan settled = plan;
  model.settle(settled, stiff.front(), {});
  EXPECT_GT(settled.refinements[0], 0);
  EXPECT_EQ(plan.refinements[0], StepPlan::kUnsettled);
  Scope finer = scope;
  finer.plan = &settled;
  const Evaluation alone = model.evaluate(soft, scope);
  const Evaluation refined = model.evaluate(soft, finer);
  EXPECT_NE(alone.outcomes.front().value()[0].substeps,
            refined.outcomes.front().value()[0].substeps);
  Evaluation first;
  Evaluation second;
  {
    const std::jthread one([&] { first = model.evaluate(soft, scope); });
    const std::jthread other([&] { second = model.evaluate(soft, finer); });
  }
  EXPECT_EQ(bits_of(seen(first)), bits_of(seen(alone)));
  EXPECT_EQ(bits_of(seen(second)), bits_of(seen(refined)));
}

}  // namespace
}  // namespace matterfit::fit
