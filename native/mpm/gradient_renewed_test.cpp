// SPDX-License-Identifier: GPL-3.0-or-later
// Gradients of runs of renewed bodies against differences, over renewals of their reference.
#include <gtest/gtest.h>

#include <string>

#include "mpm/gradient_differences_for_test.hpp"

namespace matterfit::mpm {
namespace {

using material::Law;

/// A bar that is renewed several times on its way.
GradientCase renewed_bar() {
  GradientCase run;
  run.formulation = Formulation::kRenewed;
  return run;
}

/// A substep at whose end the reference is renewed is taken again on the way back.
void expect_renewed(const std::string& name, const GradientCase& run) {
  EXPECT_GE(run.gradient<double>().recomputed, 2U) << name << ": renewals";
  expect_differences(name, run);
}

TEST(GradientRenewed, OfASolidOnTheGroundMatchesDifferences) {
  GradientCase run = renewed_bar();
  run.ground = true;
  run.material.damping_shear = 5.0;
  run.material.damping_bulk = 2.0;
  run.neighbour = true;  // an elastic body alone is renewed by its strain only
  expect_renewed("sliding beside water", run);
  run.neighbour = false;
  run.material.damping_shear = run.material.damping_bulk = 0.0;
  run.method = shape::ContactMethod::kNode;
  expect_renewed("met by nodes", run);
}

TEST(GradientRenewed, OfWhatFlowsMatchesDifferences) {
  GradientCase run = renewed_bar();
  run.ground = true;
  run.material.law = Law::kVonMises;
  run.material.yield_stress = 800.0;
  run.material.hardening = 1e4;
  expect_renewed("von Mises", run);
  run.material.hardening = 0.0;
  make_paste(run.material);
  expect_renewed("Herschel-Bulkley, relaxing", run);
  make_sand(run.material);
  expect_renewed("Drucker-Prager", run);
  make_fluid(run.material);
  expect_renewed("fluid", run);
}

TEST(GradientRenewed, OfDeformationGradientsSeenMatchesDifferences) {
  GradientCase run = renewed_bar();
  run.observes_f = true;
  run.neighbour = true;
  expect_renewed("F seen", run);
  run.neighbour = false;
  make_fluid(run.material);
  expect_renewed("fluid, F seen", run);
}

}  // namespace
}  // namespace matterfit::mpm
