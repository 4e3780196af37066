// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/classical/elastic_energy.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

namespace matterfit::material {
namespace {

/// Singular values of F.
Vec3d stretches(const Mat3d& f) {
  const Eigen::SelfAdjointEigenSolver<Mat3d> solver(f.transpose() * f, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
}

/// Σ (σ_k − 1)² of the singular values of F, as |F − R|² with F = R S by Newton's iteration
/// (Higham, SIAM J. Sci. Stat. Comput. 7, 1986); by eigenvalues where F is nearly singular.
double squared_stretch(const Mat3d& f) {
  constexpr int kMostSteps = 12;
  constexpr double kConverged = 1e-15;  // of |ΔR|², which is twice the error after that step
  Mat3d r = f;
  for (int step = 0; step < kMostSteps; ++step) {
    const double j = r.determinant();
    if (!(j > 1e-6)) break;
    const Mat3d next = 0.5 * (r + r.inverse().transpose());
    const double moved = (next - r).squaredNorm();
    r = next;
    if (moved < kConverged) return (f - r).squaredNorm();
  }
  return (stretches(f) - Vec3d::Ones()).squaredNorm();
}

/// ln cosh(z + c) − ln cosh c − z tanh c with `offset` = tanh c.
double unit_energy(double z, double offset) {
  const double c = std::atanh(offset);
  const auto log_cosh = [](double x) {
    return std::abs(x) + std::log1p(std::exp(-2.0 * std::abs(x))) - std::log(2.0);
  };
  return log_cosh(z + c) - log_cosh(c) - z * offset;
}

}  // namespace

double shape_energy(const LawConstants<double>& law, const Mat3d& f) {
  const double mu = law.mu;
  switch (law.law) {
    case Law::kFixedCorotated:
      return mu * squared_stretch(f);
    case Law::kNeoHookean: {
      const double j = f.determinant();
      if (!law.split) {
        return 0.5 * mu * (f.squaredNorm() - 3.0) - mu * std::log(j);
      }
      return 0.5 * mu * (std::pow(j, -2.0 / 3.0) * f.squaredNorm() - 3.0);
    }
    case Law::kNewtonian:
      return 0.0;
    case Law::kNeuralIsotropic: {
      const IsotropicConstants<double>& c = law.neural;
      const Vec3d strain = stretches(f).array().log();
      const double theta = strain.sum();
      const Vec3d dev = strain.array() - strain.mean();
      double energy = c.mu * dev.squaredNorm();
      for (std::size_t k = 0; k < kShapeUnits; ++k) {
        for (const double part : strain) {
          const double z = c.shape_own[k] * part + c.shape_trace[k] * theta;
          energy += c.shape_gain[k] * unit_energy(z, c.shape_offset[k]);
        }
      }
      return energy;
    }
    case Law::kStvkHencky:
    case Law::kVonMises:
    case Law::kHerschelBulkley:
    case Law::kDruckerPrager:
    case Law::kLatent:
    case Law::kPublished: {
      const Vec3d strain = stretches(f).array().log();
      return mu * (strain - Vec3d::Constant(strain.mean())).squaredNorm();
    }
  }
  return traits(law.law).energy.shape(law, f);
}

double volume_energy(const LawConstants<double>& law, double j) {
  switch (law.law) {
    case Law::kFixedCorotated:
      return 0.5 * law.lambda * (j - 1.0) * (j - 1.0);
    case Law::kNeoHookean:
      if (!law.split) {
        return 0.5 * law.lambda * std::log(j) * std::log(j);
      }
      return 0.5 * law.kappa * (j - 1.0) * (j - 1.0);
    case Law::kNewtonian:
      return law.kappa / 7.0 * (j + std::pow(j, -6.0) / 6.0 - 7.0 / 6.0);
    case Law::kNeuralIsotropic: {
      const IsotropicConstants<double>& c = law.neural;
      const double theta = std::log(j);
      double energy = 0.5 * c.kappa * theta * theta;
      for (std::size_t k = 0; k < kVolumeUnits; ++k) {
        energy += c.volume_gain[k] * unit_energy(c.volume_trace[k] * theta, c.volume_offset[k]);
      }
      return energy;
    }
    case Law::kStvkHencky:
    case Law::kVonMises:
    case Law::kHerschelBulkley:
    case Law::kDruckerPrager:
    case Law::kLatent:
    case Law::kPublished:
      return 0.5 * law.kappa * std::log(j) * std::log(j);
  }
  return traits(law.law).energy.volume(law, j);
}

double crush_energy(const LawConstants<double>& law, double j) {
  constexpr double kCrushRatio = 0.5;  // as laws-inl.hpp
  if (j >= kCrushRatio) return 0.0;
  // τ = −M ((½/J)² − 1), dΨ/dJ = τ/J.
  const double modulus = law.lambda + 2.0 * law.mu;
  const double ratio = kCrushRatio / j;
  return modulus * (0.5 * (ratio * ratio - 1.0) - std::log(ratio));
}

}  // namespace matterfit::material
