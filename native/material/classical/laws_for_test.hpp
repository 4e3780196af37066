// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "base/vec.hpp"
#include "material/classical/law_at-inl.hpp"

/// Laws at a point in double, their closed forms, and deformations to try them at.
HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

using material::law_constants;
using material::Material;

inline Mat3d from_mat3(const Mat3<double>& m) {
  Mat3d out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out(i, j) = m[i][j];
  return out;
}
inline Sym3<double> to_sym3(const Mat3d& m) {
  return {m(0, 0), m(1, 1), m(2, 2), m(1, 2), m(0, 2), m(0, 1)};
}

struct Result {
  Mat3d tau;
  Mat3d elastic;  ///< F after the return
  double strain;
};

/// `mean` is J̄; negative: the point's own.
inline Result run(const Material& m, const Mat3d& f, double strain = 0.0, double dt = 1e-4,
                  double mean = -1.0) {
  const auto c = law_constants<double>(m);
  const Mat3<double> h = to_mat3(f - Mat3d::Identity());
  Sym3<double> flow{};
  Result out;
  out.strain = strain;
  const double jm1 = determinant_minus_one(h);
  out.tau = from_sym3(
      kirchhoff_stress_at<double>(c, h, jm1, mean > 0.0 ? mean - 1.0 : jm1, dt, flow, out.strain));
  out.elastic = f * (Mat3d::Identity() + from_sym3(flow));
  return out;
}

inline Mat3d dev(const Mat3d& m) { return m - m.trace() / 3.0 * Mat3d::Identity(); }

/// Logarithm of the left stretch, by Eigen.
inline Mat3d hencky(const Mat3d& f) {
  const Eigen::SelfAdjointEigenSolver<Mat3d> eigen(f * f.transpose());
  const Vec3d e = 0.5 * eigen.eigenvalues().array().log();
  return eigen.eigenvectors() * e.asDiagonal() * eigen.eigenvectors().transpose();
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

inline Material material_of(Law law) {
  Material m;
  m.law = law;
  m.youngs_modulus = 3e5;
  m.poisson_ratio = 0.3;
  m.yield_stress = 5e3;
  m.hardening = law == Law::kVonMises ? 2e4 : 0.0;
  m.viscosity = 40.0;
  m.friction_angle = 30.0;
  m.cohesion = 500.0;
  m.bulk_modulus = 2e5;
  return m;
}

inline void expect_near(const Mat3d& a, const Mat3d& b, double tolerance) {
  EXPECT_LE((a - b).norm(), tolerance) << a << "\nagainst\n" << b;
}

inline Mat3d closed_form(const Material& m, const Mat3d& f) {
  const double mu = m.mu();
  const double lambda = m.lambda();
  const double j = f.determinant();
  const Mat3d identity = Mat3d::Identity();
  switch (m.law) {
    case Law::kFixedCorotated:
      return 2 * mu * (f - rotation_of(f)) * f.transpose() + lambda * j * (j - 1) * identity;
    case Law::kNeoHookean:
      if (m.poisson_ratio < material::kSplitPoissonRatio) {
        return mu * f * f.transpose() + (lambda * std::log(j) - mu) * identity;
      }
      return mu * std::pow(j, -2.0 / 3.0) * dev(f * f.transpose()) +
             (lambda + 2 * mu / 3) * (j - 1) * j * identity;
    case Law::kNewtonian:
      return m.bulk_modulus / 7 * (j - std::pow(j, -6.0)) * identity;
    default:
      return 2 * mu * hencky(f) + lambda * std::log(j) * identity;
  }
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
