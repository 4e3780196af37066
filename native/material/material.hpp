// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
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

/// Numbers of a correction beside a law (correction.hpp).
inline constexpr std::size_t kCorrectionSize = 5;

struct IsotropicStart;
struct LatentDecoder;
struct PublishedLaw;

/// From this strain on a limit of the isotropic neural law's flow counts as never met.
inline constexpr double kNeverStrain = 100.0;

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
  /// An energy beside the law's (correction.hpp): kCorrectionSize numbers, or none at all.
  std::vector<double> correction;

  /// Isotropic neural law (neural/isotropic_material.hpp). E and ν are its moduli at rest, `start`
  /// and the form the shape of its energy, the others its flow; no start: Hencky's energy.
  std::shared_ptr<const IsotropicStart> start;
  double form_1 = 0.0;  ///< along the start's directions, each of unit effect on the stress
  double form_2 = 0.0;
  double form_3 = 0.0;
  double form_4 = 0.0;
  double yield_strain = 1e3;       ///< |dev ε| from which it flows
  double internal_friction = 0.0;  ///< yield strain per volume strain lost
  double strain_hardening = 0.0;   ///< yield strain per equivalent plastic strain
  double tear_strain = 1e3;        ///< ln J from which it comes apart
  double flow_rate = 1e9;          ///< [1/s] at which strain beyond the yield strain is lost
  double flow_thinning = 0.0;      ///< [1/s] per strain beyond it
  /// Added to the energy's weights, one each (kIsotropicElastic), or none at all. The first, a
  /// scale, does nothing: E and ν stay the moduli at rest.
  std::vector<double> weight_moves;

  /// Latent law (neural/latent.hpp): a code, of which the decoder makes the isotropic law's Poisson
  /// ratio, start and flow above (set_latent()).
  std::shared_ptr<const LatentDecoder> decoder;
  std::vector<double> latent;

  /// Published neural law (neural/published_material.hpp), of whose nets E and ν above are the
  /// moduli at rest (published_material()).
  std::shared_ptr<const PublishedLaw> published;

  /// Lamé's first parameter and the shear modulus of the instantaneous response [Pa].
  [[nodiscard]] double lambda() const;
  [[nodiscard]] double mu() const;
  /// Fastest elastic wave √(stiffest_modulus()/ρ) [m/s] at density `rho` [kg/m³].
  [[nodiscard]] double wave_speed(double rho) const;
  /// λ + 2μ of the instantaneous response at rest, K for a fluid [Pa].
  [[nodiscard]] double p_wave_modulus() const;
  /// What it may become under load, as far as a law has a bound; else the same [Pa].
  [[nodiscard]] double stiffest_modulus() const;
  /// Those of its law, and of what its numbers make of one that spans the classes.
  [[nodiscard]] const LawTraits& traits() const;
};

/// The law of that document name. Throws Error(kInput) that lists the known names.
[[nodiscard]] Law law_from_name(std::string_view name);

/// Throws Error(kInput) naming the parameter, its value and the allowed range. `where` is the JSON
/// path of the material ("scene.bodies[0].material").
void validate(const Material& material, const std::string& where);

}  // namespace matterfit::material
