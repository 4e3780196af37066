// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "material/law_table.hpp"

namespace matterfit::material {

/// A Maxwell branch: a deviatoric spring [Pa, shear modulus] in series with a dashpot; it relaxes
/// with `time` [s] and adds to the long-term elasticity.
struct MaxwellBranch {
  double modulus = 0.0;
  double time = 0.0;
};

/// A body takes this many at most.
inline constexpr std::size_t kMostMaxwellBranches = 6;

/// A material as a job document gives it: physical values in SI units (physics of each law and the
/// conversions from the papers' codes: docs/why.md). Values that a law does not use are ignored.
struct Material {
  Law law = Law::kFixedCorotated;
  double youngs_modulus = 1e5;   ///< E [Pa]
  double poisson_ratio = 0.3;    ///< nu
  double yield_stress = 0.0;     ///< uniaxial, [Pa]: von Mises, Herschel–Bulkley
  double hardening = 0.0;        ///< [Pa] per unit of equivalent plastic strain
  double viscosity = 0.0;        ///< dynamic, [Pa s]: Newtonian, Herschel–Bulkley
  double exponent = 1.0;         ///< Herschel–Bulkley flow exponent
  double friction_angle = 30.0;  ///< [degrees]: Drucker–Prager
  double cohesion = 0.0;         ///< [Pa]: Drucker–Prager
  double bulk_modulus = 1e5;     ///< tangent at J = 1, [Pa]: Newtonian
  double damping_shear = 0.0;    ///< Kelvin–Voigt, [Pa s]
  double damping_bulk = 0.0;     ///< Kelvin–Voigt, [Pa s]
  std::vector<MaxwellBranch> maxwell;

  /// Lamé's first parameter and the shear modulus of the instantaneous response [Pa].
  [[nodiscard]] double lambda() const;
  [[nodiscard]] double mu() const;
  /// Fastest elastic wave √((λ+2μ)/ρ) or √(K/ρ) [m/s] at density `rho` [kg/m³].
  [[nodiscard]] double wave_speed(double rho) const;
  /// λ + 2μ of the instantaneous response, K for a fluid [Pa].
  [[nodiscard]] double p_wave_modulus() const;
  [[nodiscard]] const LawTraits& traits() const { return material::traits(law); }
};

/// The law of that document name. Throws Error(kInput) that lists the known names.
[[nodiscard]] Law law_from_name(std::string_view name);

/// Throws Error(kInput) naming the parameter, its value and the allowed range. `where` is the JSON
/// path of the material ("scene.bodies[0].material").
void validate(const Material& material, const std::string& where);

}  // namespace matterfit::material
