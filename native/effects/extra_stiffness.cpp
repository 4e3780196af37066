// SPDX-License-Identifier: GPL-3.0-or-later
#include "effects/extra_stiffness.hpp"

#include <Eigen/LU>
#include <cmath>

namespace matterfit::effects {
namespace {

/// μ and λ over Young's modulus.
struct Ratios {
  double mu;
  double lambda;
};

Ratios ratios(double nu) { return {0.5 / (1.0 + nu), nu / ((1.0 + nu) * (1.0 - 2.0 * nu))}; }

}  // namespace

Mat3d extra_stress(double modulus, double nu, const Mat3d& f) {
  const Ratios r = ratios(nu);
  const Mat3d strain = f * f.transpose() - Mat3d::Identity();
  return modulus * (r.mu * strain + r.lambda * std::log(f.determinant()) * Mat3d::Identity());
}

ExtraStressBar extra_stress_adjoint(double modulus, double nu, const Mat3d& f,
                                    const Mat3d& stress_bar) {
  const Ratios r = ratios(nu);
  const Mat3d strain = f * f.transpose() - Mat3d::Identity();
  const double log_j = std::log(f.determinant());
  const double of_mu = (stress_bar.array() * strain.array()).sum();
  const double of_lambda = stress_bar.trace() * log_j;
  ExtraStressBar bar;
  bar.modulus = r.mu * of_mu + r.lambda * of_lambda;
  // λ/E = ν/(1 − ν − 2ν²).
  const double below = (1.0 + nu) * (1.0 - 2.0 * nu);
  bar.nu = modulus * (-0.5 / ((1.0 + nu) * (1.0 + nu)) * of_mu +
                      (1.0 + 2.0 * nu * nu) / (below * below) * of_lambda);
  bar.f = modulus * (r.mu * (stress_bar + stress_bar.transpose()) * f +
                     r.lambda * stress_bar.trace() * f.inverse().transpose());
  return bar;
}

double wave_modulus_ratio(double nu) {
  const Ratios r = ratios(nu);
  return r.lambda + 2.0 * r.mu;
}

}  // namespace matterfit::effects
