// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Dense>
#include <cmath>

#include "base/vec.hpp"
#include "material/classical/law_at-inl.hpp"
#include "math/mat3_for_test.hpp"

/// Laws at a point in double, and their closed forms.
HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

using material::law_constants;
using material::Material;

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
