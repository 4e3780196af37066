// SPDX-License-Identifier: GPL-3.0-or-later
// The algebra of 3×3 matrices that the laws are made of, in double.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "base/vec.hpp"
#include "math/mat3_for_test.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {
namespace {

TEST(Algebra, EigenpairsOfSymmetricMatrices) {
  std::mt19937 random(13);
  std::vector<Mat3d> cases = {Mat3d::Zero(), Mat3d::Identity(), Vec3d(2, 2, -1).asDiagonal(),
                              Vec3d(1e-9, 1, 1e9).asDiagonal()};
  for (const double gap : {0.0, 1e-12, 1e-7, 1e-3, 1.0}) {
    for (int k = 0; k < 8; ++k) {
      const Mat3d q = random_rotation(random);
      cases.emplace_back(q * Vec3d(0.3, 0.3 + gap, 0.3 + 2 * gap).asDiagonal() * q.transpose());
      cases.emplace_back(q * Vec3d(-0.9, -0.9 + gap, 4.0).asDiagonal() * q.transpose());
    }
  }
  for (const Mat3d& m : cases) {
    double values[3];
    Mat3<double> vectors;
    eigen_symmetric(to_sym3(m), values, vectors);
    const Mat3d v = from_mat3(vectors);
    const double scale = 1e-14 * std::max(1.0, m.norm());
    expect_near(v.transpose() * v, Mat3d::Identity(), 1e-14);
    expect_near(m * v, v * Vec3d(values[0], values[1], values[2]).asDiagonal(), 10 * scale);
    Vec3d sorted(values[0], values[1], values[2]);
    std::sort(sorted.data(), sorted.data() + 3);
    const Eigen::SelfAdjointEigenSolver<Mat3d> eigen(m);
    EXPECT_LE((sorted - eigen.eigenvalues()).norm(), 10 * scale);
  }
}

TEST(Algebra, PolarRotation) {
  for (const double size : {0.0, 1e-9, 0.1, 1.0, 3.0}) {
    for (const Mat3d& f : deformations(size)) {
      const Mat3d r = from_mat3(polar_rotation(to_mat3(f)));
      expect_near(r.transpose() * r, Mat3d::Identity(), 1e-12);
      EXPECT_NEAR(r.determinant(), 1.0, 1e-12);
      expect_near(r, rotation_of(f), 1e-11);
    }
  }
}

TEST(Algebra, StrainsKeepTheDigitsOfSmallDisplacementGradients) {
  Mat3d h = Mat3d::Zero();
  h(0, 0) = 1e-18;
  h(1, 2) = 3e-18;
  EXPECT_DOUBLE_EQ(determinant_minus_one(to_mat3(h)), 1e-18);
  EXPECT_DOUBLE_EQ(right_cauchy_green_minus_identity(to_mat3(h)).xx, 2e-18);
  EXPECT_DOUBLE_EQ(left_cauchy_green_minus_identity(to_mat3(h)).yz, 3e-18);
  for (const double x : {-3.0, -0.1000001, -0.0999999, -1e-12, 0.0, 1e-12, 0.05, 0.1, 2.0}) {
    EXPECT_NEAR(expm1_small(x), std::expm1(x), 4e-15 * std::max(1.0, std::abs(std::expm1(x)))) << x;
  }
  EXPECT_NEAR(expm1_small(1e-12) / std::expm1(1e-12), 1.0, 1e-15);
}

}  // namespace
}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
