// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/classical/point_law.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

namespace matterfit::material {
namespace {

Mat3d stretched(double x) { return Vec3d(x, 1.0, 1.0).asDiagonal(); }

TEST(PointLaw, AnElasticStressDoesNotDependOnThePath) {
  Material m;
  m.law = Law::kStvkHencky;
  const PointLaw law(m, 1e-3);
  PointState once;
  PointState many;
  const Mat3d whole = law.advance(stretched(std::exp(0.2)), once);
  Mat3d last;
  for (int k = 0; k < 10; ++k) last = law.advance(stretched(std::exp(0.02)), many);
  EXPECT_LT((whole - last).norm(), 1e-9 * whole.norm());
  EXPECT_NEAR(whole(0, 0), 0.2 * (m.lambda() + 2.0 * m.mu()), 1e-6 * whole(0, 0));
}

TEST(PointLaw, APlasticStressStaysOnTheYieldSurface) {
  Material m;
  m.law = Law::kVonMises;
  m.yield_stress = 1e3;
  const PointLaw law(m, 1e-3);
  PointState state;
  Mat3d tau;
  for (int k = 0; k < 20; ++k) tau = law.advance(stretched(1.01), state);
  const Mat3d s = tau - tau.trace() / 3.0 * Mat3d::Identity();
  EXPECT_NEAR(s.norm(), std::sqrt(2.0 / 3.0) * 1e3, 1e-6);
  EXPECT_GT(state.strain, 0.1);
}

TEST(PointLaw, AFluidAndADamperFeelTheRate) {
  Material m;
  m.law = Law::kNewtonian;
  m.viscosity = 3.0;
  const double dt = 1e-3;
  PointState state;
  Mat3d step = Mat3d::Identity();
  step(0, 1) = 0.01;
  const Mat3d tau = PointLaw(m, dt).advance(step, state);
  EXPECT_NEAR(tau(0, 1), 3.0 * 0.01 / dt, 1e-9);
  EXPECT_EQ(state.elastic, Mat3d::Identity());
}

TEST(PointLaw, ABranchRelaxes) {
  Material m;
  m.youngs_modulus = 1.0;
  m.maxwell = {{1e4, 0.05}};
  const PointLaw law(m, 1e-3);
  PointState state;
  Mat3d step = Mat3d::Identity();
  step(0, 1) = 1e-3;
  const double first = law.advance(step, state)(0, 1);
  EXPECT_NEAR(first, 10.0, 0.15);
  double last = first;
  for (int k = 0; k < 50; ++k) last = law.advance(Mat3d::Identity(), state)(0, 1);
  EXPECT_NEAR(last / first, std::exp(-1.0), 0.01);
}

}  // namespace
}  // namespace matterfit::material
