// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/vec.hpp"

namespace matterfit::effects {

/// An elastic stress beside that of a body's own law, compressible neo-Hookean:
/// τ = μ (F Fᵀ − I) + λ ln J I (Bonet and Wood, Nonlinear Continuum Mechanics, §6.4), μ and λ of
/// Young's modulus `modulus` [Pa], which may be negative, and Poisson's ratio `nu`.
[[nodiscard]] Mat3d extra_stress(double modulus, double nu, const Mat3d& f);

/// Cotangents of what extra_stress() depends on.
struct ExtraStressBar {
  double modulus = 0.0;
  double nu = 0.0;
  Mat3d f = Mat3d::Zero();
};
[[nodiscard]] ExtraStressBar extra_stress_adjoint(double modulus, double nu, const Mat3d& f,
                                                  const Mat3d& stress_bar);

/// λ + 2μ over Young's modulus.
[[nodiscard]] double wave_modulus_ratio(double nu);

}  // namespace matterfit::effects
