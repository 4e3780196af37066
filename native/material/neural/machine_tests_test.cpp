// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/machine_tests.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"
#include "material/neural/isotropic_material.hpp"

namespace matterfit::material {
namespace {

constexpr double kShear = 4e5;

/// A test of a neo-Hookean that stiffens besides: μ₁(λ − 1/λ²) and a term of Ogden's of α = 8.
MachineTest pulled(double most) {
  MachineTest test;
  for (int k = 0; k <= 20; ++k) {
    const double by = 1.0 + (most - 1.0) * k / 20.0;
    test.by.push_back(by);
    test.nominal.push_back(kShear * (by - std::pow(by, -2.0)) +
                           20.0 * (std::pow(by, 7.0) - std::pow(by, -5.0)));
  }
  return test;
}

std::vector<double> nominal_of(const Material& law, const MachineTest& test) {
  std::vector<double> all;
  for (const CurvePoint& point : stress_curve(law, test.pull, test.by, 1.0)) {
    all.push_back(point.nominal);
  }
  return all;
}

TEST(MachineTests, AStiffeningRubberIsFollowed) {
  const std::vector<MachineTest> tests = {pulled(4.0)};
  const Material law =
      isotropic_material(with_directions("rubber", regress_machine_tests(tests, 0.4995), 1));
  EXPECT_GT(r_squared(nominal_of(law, tests[0]), tests[0].nominal), 0.999);
  EXPECT_NEAR(law.poisson_ratio, 0.4995, 1e-4);
  EXPECT_EQ(law.traits().elastic(), true);
}

TEST(MachineTests, WhatNoTestShowsIsTheNeoHookeans) {
  const std::vector<MachineTest> tests = {pulled(3.0)};
  const double shear = neo_hookean_of_tests(tests);
  const Material law =
      isotropic_material(with_directions("rubber", regress_machine_tests(tests, 0.4995), 1));
  for (const double by : {1.2, 1.6, 2.0}) {
    const double wanted = shear * (by - std::pow(by, -5.0));
    const double found = stress_curve(law, Pull::kEquibiaxial, std::array{by}, 1.0)[0].nominal;
    EXPECT_NEAR(found, wanted, 0.15 * wanted) << by;
  }
}

TEST(MachineTests, BothSidesAreFollowedWhereBothAreShown) {
  std::vector<MachineTest> tests = {pulled(3.0), {Pull::kEquibiaxial, {}, {}}};
  for (int k = 1; k <= 15; ++k) {
    const double by = 1.0 + 0.1 * k;
    tests[1].by.push_back(by);
    tests[1].nominal.push_back(1.3 * kShear * (by - std::pow(by, -5.0)));
  }
  const Material law =
      isotropic_material(with_directions("rubber", regress_machine_tests(tests, 0.4995), 1));
  for (const MachineTest& test : tests) {
    EXPECT_GT(r_squared(nominal_of(law, test), test.nominal), 0.995);
  }
}

TEST(MachineTests, TestsThatSayNothingAreRefused) {
  EXPECT_THROW((void)regress_machine_tests({}, 0.49), Error);
  std::vector<MachineTest> tests = {pulled(2.0)};
  EXPECT_THROW((void)regress_machine_tests(tests, 0.5), Error);
  tests[0].by.pop_back();
  EXPECT_THROW((void)regress_machine_tests(tests, 0.49), Error);
  tests = {{Pull::kUniaxial, {1.0, 1.1}, {0.0, -5.0}}};
  EXPECT_THROW((void)regress_machine_tests(tests, 0.49), Error);
}

}  // namespace
}  // namespace matterfit::material
