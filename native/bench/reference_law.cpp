// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench/reference_law.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.hpp"

namespace matterfit::bench {
namespace {

/// Elastic principal strains after the return, from the trial ones.
Vec3d returned(const ReferenceMaterial& material, const Vec3d& trial, double dt) {
  const double mu = material.mu();
  const double trace = trial.sum();
  const Vec3d deviator = trial - Vec3d::Constant(trace / 3.0);
  const double length = deviator.norm();
  if (material.law == ReferenceLaw::kDruckerPrager) {
    if (trace >= 0.0) return Vec3d::Zero();
    const double sine = std::sin(material.friction_angle * std::numbers::pi / 180.0);
    const double alpha = std::sqrt(2.0 / 3.0) * 2.0 * sine / (3.0 - sine);
    const double limit = -(3.0 * material.lambda() + 2.0 * mu) / (2.0 * mu) * trace * alpha;
    if (length <= limit) return trial;
    return deviator * (limit / length) + Vec3d::Constant(trace / 3.0);
  }
  const double stress = 2.0 * mu * length;
  const double excess = stress - std::sqrt(2.0 / 3.0) * material.yield_stress;
  if (excess <= 0.0) return trial;
  double share = 1.0;  // of the excess, which flows off within this step
  if (material.law == ReferenceLaw::kHerschelBulkley) {
    const double stretched_mu = mu * (2.0 * trial).array().exp().sum() / 3.0;
    share = 1.0 / (1.0 + material.viscosity / (stretched_mu * dt));
  }
  return deviator * ((stress - share * excess) / stress) + Vec3d::Constant(trace / 3.0);
}

/// Shear modulus of the rubber at |dev ε| = s; takes s into its memory.
double rubber_modulus(const ReferenceMaterial& material, double s, ReferenceState& state) {
  state.largest = std::max(state.largest, s);
  const double share = state.largest > 0.0 ? s / state.largest : 1.0;
  return material.mu() * (1.0 + material.stiffening * s) *
         (1.0 - material.softening * (1.0 - share));
}

Mat3d with_eigenvalues(const Mat3d& U, const Vec3d& values) {
  return U * values.asDiagonal() * U.transpose();
}

}  // namespace

double ReferenceMaterial::mu() const { return youngs_modulus / (2.0 * (1.0 + poisson_ratio)); }

double ReferenceMaterial::lambda() const {
  return youngs_modulus * poisson_ratio / ((1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio));
}

double ReferenceMaterial::wave_speed(double density) const {
  double modulus = law == ReferenceLaw::kNewtonian ? bulk_modulus : lambda() + 2.0 * mu();
  // d/ds of 2 μ (1 + a s) s is 2 μ (1 + 2 a s).
  if (law == ReferenceLaw::kMullins) modulus += 2.0 * mu() * stiffening;
  return std::sqrt(modulus / density);
}

Mat3d advance(const ReferenceMaterial& material, const Mat3d& L, double dt, ReferenceState& state) {
  if (material.law == ReferenceLaw::kNewtonian) {
    state.J *= 1.0 + dt * L.trace();
    const double pressure = material.bulk_modulus / 7.0 * (state.J - std::pow(state.J, -6.0));
    return pressure * Mat3d::Identity() + material.viscosity * state.J * (L + L.transpose());
  }
  const Mat3d step = Mat3d::Identity() + dt * L;
  state.b = step * state.b * step.transpose();
  if (material.law == ReferenceLaw::kNeoHookean) {
    const double log_J = 0.5 * std::log(state.b.determinant());
    return material.mu() * state.b +
           (material.lambda() * log_J - material.mu()) * Mat3d::Identity();
  }
  Eigen::SelfAdjointEigenSolver<Mat3d> solver;
  solver.computeDirect(state.b);
  if (!(solver.eigenvalues().minCoeff() > 0.0)) {
    throw_compute("A particle was turned inside out: the fixed substep is too long.");
  }
  const Mat3d& U = solver.eigenvectors();
  const Vec3d trial = 0.5 * solver.eigenvalues().array().log();
  if (material.law == ReferenceLaw::kMullins) {
    const double trace = trial.sum();
    const Vec3d deviator = trial - Vec3d::Constant(trace / 3.0);
    const double bulk = material.lambda() + 2.0 / 3.0 * material.mu();
    const double shear = rubber_modulus(material, deviator.norm(), state);
    return with_eigenvalues(U, 2.0 * shear * deviator + Vec3d::Constant(bulk * trace));
  }
  const Vec3d strain = returned(material, trial, dt);
  if (strain != trial) state.b = with_eigenvalues(U, (2.0 * strain).array().exp());
  return with_eigenvalues(
      U, 2.0 * material.mu() * strain + Vec3d::Constant(material.lambda() * strain.sum()));
}

}  // namespace matterfit::bench
