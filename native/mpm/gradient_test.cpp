// SPDX-License-Identifier: GPL-3.0-or-later
// Gradients of whole runs against fourth-order differences of whole runs, in double.
#include "mpm/gradient.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "mpm/gradient_differences_for_test.hpp"

namespace matterfit::mpm {
namespace {

using material::Law;
using Hold = GradientCase::Hold;

TEST(Gradient, OfABarOnTheGroundMatchesDifferences) {
  GradientCase run;
  run.ground = true;
  run.material.damping_shear = 5.0;
  run.material.damping_bulk = 2.0;
  run.fps = 30.0;
  expect_differences("sliding", run);
  run.fps = 100.0;
  run.mu = 5.0;
  expect_differences("sticking", run);
  run.mu = 0.3;
  run.material.maxwell = {{5e4, 2e-3}, {8e4, 0.02}};
  run.masses = true;
  expect_differences("relaxing, with masses", run);
}

TEST(Gradient, OfPinsThatLetGoMatchesDifferences) {
  GradientCase run;
  run.hold = Hold::kPlane;
  run.release = 0.023;
  run.material.maxwell = {{5e4, 2e-3}};
  expect_differences("plane let go", run);
  run.hold = Hold::kPatch;
  run.masses = true;
  expect_differences("moved patch let go, masses", run);
  run.hold = Hold::kAll;
  run.masses = false;
  run.ground = true;
  run.offset = Vec3d(0.0, 0.0, -0.01);  // in the ground already
  expect_differences("held, then let go to the ground", run);
}

TEST(Gradient, OfPlasticBodiesMatchesDifferences) {
  GradientCase run;
  run.ground = true;
  run.material.law = Law::kVonMises;
  run.material.yield_stress = 800.0;
  run.material.hardening = 1e4;
  expect_differences("von Mises", run);
  make_paste(run.material);
  expect_differences("Herschel-Bulkley, relaxing", run);
  make_sand(run.material);
  expect_differences("Drucker-Prager", run);
}

TEST(Gradient, OfUpdatedBodiesMatchesDifferences) {
  GradientCase run;
  run.formulation = Formulation::kUpdated;
  run.ground = true;
  run.material.damping_shear = 5.0;
  run.material.damping_bulk = 2.0;
  expect_differences("updated, sliding", run);
  run.material.damping_shear = run.material.damping_bulk = 0.0;
  run.method = shape::ContactMethod::kNode;
  expect_differences("updated, met by nodes", run);
  run.method = shape::ContactMethod::kParticle;
  make_paste(run.material);
  expect_differences("updated Herschel-Bulkley, relaxing", run);
  run.material.maxwell.clear();
  make_fluid(run.material);
  expect_differences("updated fluid", run);
}

TEST(Gradient, OfUpdatedBodiesThatTouchAndArePinnedMatchesDifferences) {
  GradientCase run;
  run.formulation = Formulation::kUpdated;
  run.neighbour = true;
  run.ground = true;
  expect_differences("solid beside water", run);
  run.ground = false;
  run.neighbour = false;
  run.hold = Hold::kPatch;
  run.release = 0.033;
  expect_differences("updated, moved patch let go", run);
  run.masses = true;
  expect_differences("updated, with attached masses", run);
  run.hold = Hold::kNone;
  make_fluid(run.material);
  expect_differences("updated fluid with attached masses", run);
}

TEST(Gradient, OfDeformationGradientsSeenMatchesDifferences) {
  GradientCase run;
  run.observes_f = true;
  expect_differences("total, F seen", run);
  run.formulation = Formulation::kUpdated;
  expect_differences("updated, F seen", run);
  make_fluid(run.material);
  expect_differences("updated fluid, F seen", run);
}

/// What a material has nothing of: differences to the one side that there is.
TEST(Gradient, ByDampingAndViscosityThatAreZeroMatchesDifferences) {
  const auto expect = [](const std::string& name, const GradientCase& run, double found,
                         double material::Material::*member, double unit) {
    const Schedule schedule = run.gradient<double>().schedule;
    const auto value = [&](double by) {
      GradientCase moved = run;
      moved.material.*member += by * unit;
      return moved.loss(schedule);
    };
    double error = 1.0;
    double expected = 0.0;
    for (double step = 1e-3; step > 1e-7 && error > 1e-6; step *= 0.1) {
      expected = (-11.0 * value(0.0) + 18.0 * value(step) - 9.0 * value(2.0 * step) +
                  2.0 * value(3.0 * step)) /
                 (6.0 * step);
      error = std::abs(expected - unit * found) / std::max(std::abs(expected), 1.0);
    }
    EXPECT_LE(error, 1e-6) << name << ": difference " << expected << ", gradient " << unit * found;
    EXPECT_NE(found, 0.0) << name;
  };
  using material::Material;
  for (const Formulation formulation : {Formulation::kTotal, Formulation::kUpdated}) {
    const std::string of = formulation == Formulation::kTotal ? "total, " : "updated, ";
    GradientCase run;
    run.formulation = formulation;
    run.frames = 3;
    const Gradient g = run.gradient<double>();
    expect(of + "shear damping", run, g.bodies[0].material.damping_shear, &Material::damping_shear,
           10.0);
    expect(of + "bulk damping", run, g.bodies[0].material.damping_bulk, &Material::damping_bulk,
           10.0);
    run.material.law = Law::kHerschelBulkley;
    run.material.yield_stress = 800.0;
    run.material.viscosity = 0.0;
    expect(of + "viscosity", run, run.gradient<double>().bodies[0].material.viscosity,
           &Material::viscosity, 10.0);
  }
  GradientCase water;
  water.formulation = Formulation::kUpdated;
  water.frames = 3;
  make_fluid(water.material, 0.0);
  expect("fluid's viscosity", water, water.gradient<double>().bodies[0].material.viscosity,
         &Material::viscosity, 10.0);
}

/// A bar that swings and comes to rest, over more than two thousand substeps.
TEST(Gradient, OfALongDampedRunStaysRight) {
  GradientCase run;
  run.hold = Hold::kPlane;
  run.frames = 101;
  run.substeps = 25;
  run.material.damping_shear = 40.0;
  run.material.damping_bulk = 20.0;
  run.stir = 0.2;
  expect_differences("long", run,
                     {"E", "damping", "density", "velocity x", "gravity z", "offset y"});
}

}  // namespace
}  // namespace matterfit::mpm
