// SPDX-License-Identifier: GPL-3.0-or-later
// Adjoints of Maxwell branches in both formulations against central differences in double.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "material/classical/law_gradient.hpp"
#include "material/classical/maxwell_adjoint-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {
namespace {

using material::law_constants;
using material::Material;

constexpr double kStep = 2e-2;

double by_maxwell(double& x, double step, const std::function<double()>& value) {
  const double at = x;
  const auto moved = [&](double by) {
    x = at + by;
    const double v = value();
    x = at;
    return v;
  };
  return (8.0 * (moved(step) - moved(-step)) - (moved(2.0 * step) - moved(-2.0 * step))) /
         (12.0 * step);
}

class MaxwellAdjoint : public testing::Test {
 protected:
  std::mt19937 random{23};
  std::uniform_real_distribution<double> uniform{-1.0, 1.0};
  Material material;
  Mat3<double> h{};
  double history[24] = {};
  Sym3<double> tau_bar{};
  Sym3<double> next_bar[2] = {};

  MaxwellAdjoint() {
    material.maxwell = {{1.5, 0.05}, {0.7, 0.4}};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) h[i][j] = 0.3 * uniform(random);
    for (double& g : history) g = 0.2 * uniform(random);
    const auto symmetric = [&] {
      return Sym3<double>{uniform(random), uniform(random), uniform(random),
                          uniform(random), uniform(random), uniform(random)};
    };
    tau_bar = symmetric();
    next_bar[0] = symmetric();
    next_bar[1] = symmetric();
    // What rounding took is no variable.
    for (int i = 0; i < 2; ++i)
      for (int k = 6; k < 12; ++k) history[12 * i + k] = 0.0;
  }

  /// A symmetric tensor's entry moves both of its places.
  static double entry(const Sym3<double>& s, int i) {
    const double off[3] = {s.yz, s.xz, s.xy};
    const double on[3] = {s.xx, s.yy, s.zz};
    return i < 3 ? on[i] : 2.0 * off[i - 3];
  }
};

TEST_F(MaxwellAdjoint, TotalLagrangian) {
  const auto value = [&] {
    const double jm1 = determinant_minus_one(h);
    const auto c = law_constants<double>(material);
    MaxwellStep<double> steps[material::kMostMaxwellBranches];
    maxwell_steps(c, kStep, steps);
    double after[24];
    std::copy(history, history + 24, after);
    Sym3<double> tau{};
    add_maxwell_stress<double>(c, steps, h, jm1, true, after, 1, tau);
    double sum = contract(tau_bar, tau);
    for (int i = 0; i < 2; ++i) sum += contract(next_bar[i], load_sym3<double>(after + 12 * i, 1));
    return sum;
  };
  const auto c = law_constants<double>(material);
  MaxwellStep<double> steps[material::kMostMaxwellBranches];
  maxwell_steps(c, kStep, steps);
  PointBar<double> bar{};
  MaxwellStepBar<double> steps_bar[2] = {};
  Sym3<double> g_bar[2] = {next_bar[0], next_bar[1]};
  const double jm1 = determinant_minus_one(h);
  maxwell_stress_adjoint<double>(c, steps, h, jm1, history, 1, tau_bar, g_bar, bar, steps_bar);
  add_scaled(cofactor(plus_identity(h)), bar.jm1, bar.h);  // J is that of h
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      EXPECT_NEAR(by_maxwell(h[i][j], 1e-3, value), bar.h[i][j], 1e-8) << i << j;
    }
  for (int b = 0; b < 2; ++b) {
    for (int k = 0; k < 6; ++k) {
      EXPECT_NEAR(by_maxwell(history[12 * b + k], 1e-3, value), entry(g_bar[b], k), 1e-8);
    }
    const auto g = material::maxwell_gradient(material.maxwell[static_cast<std::size_t>(b)], kStep,
                                              steps_bar[b].stiffness, steps_bar[b].relaxed);
    material::MaxwellBranch& branch = material.maxwell[static_cast<std::size_t>(b)];
    EXPECT_NEAR(by_maxwell(branch.modulus, 1e-3, value), g.modulus, 1e-8);
    EXPECT_NEAR(by_maxwell(branch.time, 1e-4, value), g.time, 1e-7);
  }
}

TEST_F(MaxwellAdjoint, UpdatedLagrangian) {
  const auto value = [&] {
    const auto c = law_constants<double>(material);
    MaxwellStep<double> steps[material::kMostMaxwellBranches];
    maxwell_steps(c, kStep, steps);
    Sym3<double> tau{};
    const Sym3<double> next =
        carry_maxwell<double>(steps[0], h, load_sym3<double>(history, 1), tau);
    return contract(tau_bar, tau) + contract(next_bar[0], next);
  };
  const auto c = law_constants<double>(material);
  MaxwellStep<double> steps[material::kMostMaxwellBranches];
  maxwell_steps(c, kStep, steps);
  Mat3<double> step_bar{};
  MaxwellStepBar<double> over_bar{};
  const Sym3<double> a_bar = carry_maxwell_adjoint<double>(
      steps[0], h, load_sym3<double>(history, 1), tau_bar, next_bar[0], step_bar, over_bar);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      EXPECT_NEAR(by_maxwell(h[i][j], 1e-3, value), step_bar[i][j], 1e-8) << i << j;
    }
  for (int k = 0; k < 6; ++k) {
    EXPECT_NEAR(by_maxwell(history[k], 1e-3, value), entry(a_bar, k), 1e-8);
  }
  const auto g =
      material::maxwell_gradient(material.maxwell[0], kStep, over_bar.stiffness, over_bar.relaxed);
  EXPECT_NEAR(by_maxwell(material.maxwell[0].modulus, 1e-3, value), g.modulus, 1e-8);
  EXPECT_NEAR(by_maxwell(material.maxwell[0].time, 1e-4, value), g.time, 1e-7);
}

}  // namespace
}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
