// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>

#include "base/vec.hpp"
#include "material/neural/isotropic_weights.hpp"

namespace matterfit::material {

/// The isotropic law in principal axes.
struct PrincipalResponse {
  Vec3d tau;  ///< Kirchhoff stresses [Pa]
  /// Derivatives of the stresses by the weights of the energy.
  Eigen::Matrix<double, 3, static_cast<int>(kIsotropicElastic)> by_weights;
};

/// Stresses of principal Hencky strains by the energy alone, without flow.
[[nodiscard]] PrincipalResponse principal_response(const IsotropicWeights& weights,
                                                   const Vec3d& strain);

/// The same stresses alone, of constants; and their adjoint, which adds to the cotangents of the
/// energy's constants.
[[nodiscard]] Vec3d principal_stress(const IsotropicConstants<double>& c, const Vec3d& strain);
void add_principal_stress_adjoint(const IsotropicConstants<double>& c, const Vec3d& strain,
                                  const Vec3d& tau_bar, IsotropicConstants<double>& c_bar);

/// Strains that the flow keeps of a trial in a step of `dt` [s]; `plastic` is the equivalent
/// plastic strain and grows.
[[nodiscard]] Vec3d principal_flow(const IsotropicWeights& weights, const Vec3d& trial, double dt,
                                   double& plastic);

}  // namespace matterfit::material
