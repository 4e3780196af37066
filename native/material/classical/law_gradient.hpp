// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "material/classical/constants_adjoint.hpp"
#include "material/material.hpp"

namespace matterfit::material {

/// Derivatives of a number with respect to a material's parameters, in their units (the friction
/// angle's per degree); those that the law does not use are 0.
struct MaterialGradient {
  double youngs_modulus = 0.0;
  double poisson_ratio = 0.0;
  double yield_stress = 0.0;
  double hardening = 0.0;
  double viscosity = 0.0;
  double exponent = 0.0;
  double friction_angle = 0.0;
  double cohesion = 0.0;
  double bulk_modulus = 0.0;
  double damping_shear = 0.0;
  double damping_bulk = 0.0;
  double form_1 = 0.0;
  double form_2 = 0.0;
  double form_3 = 0.0;
  double form_4 = 0.0;
  double yield_strain = 0.0;
  double internal_friction = 0.0;
  double strain_hardening = 0.0;
  double tear_strain = 0.0;
  double flow_rate = 0.0;
  double flow_thinning = 0.0;
  std::vector<double> weight_moves;  ///< as many as the material has
  std::vector<double> latent;        ///< by the code of the latent law; empty: of another one
  /// By the published law's weights (joined_weights()), where they were asked for; else empty.
  std::vector<double> published;
  std::vector<MaxwellBranch> maxwell;  ///< by modulus and by time
  /// By the numbers of a correction (material/correction.hpp); empty: the material has none.
  std::vector<double> correction;
};

/// The chain rule through law_constants(): `constants` are the derivatives with respect to its
/// entries.
[[nodiscard]] MaterialGradient material_gradient(const Material& material,
                                                 const ConstantsAdjoint<double>& constants);

/// Derivatives with respect to a branch's modulus and time, from those with respect to its
/// stiffness and relaxed share over a substep `dt` [s] (material/classical/maxwell-inl.hpp).
[[nodiscard]] MaxwellBranch maxwell_gradient(const MaxwellBranch& branch, double dt,
                                             double stiffness, double relaxed);

}  // namespace matterfit::material
