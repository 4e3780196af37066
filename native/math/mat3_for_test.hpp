// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>
#include <vector>

#include "base/vec.hpp"
#include "math/mat3_eigen-inl.hpp"

/// 3×3 matrices to try algebra and laws at, and Eigen's answers.
HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

inline Mat3d from_mat3(const Mat3<double>& m) {
  Mat3d out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out(i, j) = m[i][j];
  return out;
}
inline Sym3<double> to_sym3(const Mat3d& m) {
  return {m(0, 0), m(1, 1), m(2, 2), m(1, 2), m(0, 2), m(0, 1)};
}

inline Mat3d rotation_of(const Mat3d& f) {
  const Eigen::JacobiSVD<Mat3d> svd(f, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.matrixV().transpose();
}

inline Mat3d random_rotation(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Quatd(normal(random), normal(random), normal(random), normal(random))
      .normalized()
      .toRotationMatrix();
}

/// Deformations with singular values e^±size, among them repeated ones, turned both ways.
inline std::vector<Mat3d> deformations(double size, int count = 24) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-size, size);
  std::vector<Mat3d> out;
  for (int i = 0; i < count; ++i) {
    Vec3d e(uniform(random), uniform(random), uniform(random));
    if (i % 4 == 1) e[1] = e[0];
    if (i % 4 == 2) e = Vec3d::Constant(e[0]);
    const Vec3d sigma = e.array().exp();
    out.emplace_back(random_rotation(random) * sigma.asDiagonal() * random_rotation(random));
  }
  return out;
}

inline void expect_near(const Mat3d& a, const Mat3d& b, double tolerance) {
  EXPECT_LE((a - b).norm(), tolerance) << a << "\nagainst\n" << b;
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
