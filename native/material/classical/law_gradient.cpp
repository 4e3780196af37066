// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/classical/law_gradient.hpp"

#include <cmath>
#include <numbers>

#include "material/neural/isotropic_material.hpp"
#include "material/neural/latent.hpp"

namespace matterfit::material {

MaterialGradient material_gradient(const Material& m, const ConstantsAdjoint<double>& c) {
  MaterialGradient out;
  out.damping_shear = c.damping_shear;
  out.damping_bulk = c.damping_bulk;
  out.maxwell.resize(m.maxwell.size());
  for (MaxwellBranch& branch : out.maxwell) branch = {0.0, 0.0};
  if (m.traits().fluid) {
    out.bulk_modulus = c.kappa + c.lambda;
    out.viscosity = c.eta;
    return out;
  }
  double of_lambda = c.lambda + c.kappa;
  double of_mu = c.mu + 2.0 / 3.0 * c.kappa;
  if (is_isotropic(m.law)) {
    const ModuliGradient of_moduli = add_isotropic_gradient(m, c.neural, out);
    of_lambda += of_moduli.bulk;
    of_mu += of_moduli.shear + 2.0 / 3.0 * of_moduli.bulk;
  }
  const double e = m.youngs_modulus;
  const double nu = m.poisson_ratio;
  const double lambda = m.lambda();
  const double mu = e / (2.0 * (1.0 + nu));
  if (m.law == Law::kDruckerPrager) {
    const double phi = m.friction_angle * std::numbers::pi / 180.0;
    const double sine = std::sin(phi);
    const double cosine = std::cos(phi);
    const double bulk3 = 3.0 * lambda + 2.0 * mu;
    const double root = std::sqrt(2.0 / 3.0);
    const double scale = root * 2.0 / (3.0 - sine);
    const double scale_phi = root * 2.0 * cosine / ((3.0 - sine) * (3.0 - sine));
    double of_phi = c.alpha * (scale_phi * sine + scale * cosine);
    double of_bulk3 = 0.0;
    const double alpha_tip = scale * m.cohesion * cosine / bulk3;
    of_phi += c.alpha_tip * m.cohesion / bulk3 * (scale_phi * cosine - scale * sine);
    of_bulk3 -= c.alpha_tip * alpha_tip / bulk3;
    out.cohesion += c.alpha_tip * scale * cosine / bulk3;
    if (phi > 0.0) {
      const double tip = m.cohesion / (std::tan(phi) * bulk3);
      if (tip < 1.0) {  // beyond, law_constants() holds it at 1
        out.cohesion += c.tip / (std::tan(phi) * bulk3);
        of_phi -= c.tip * m.cohesion / (sine * sine * bulk3);
        of_bulk3 -= c.tip * tip / bulk3;
      }
    }
    of_lambda += 3.0 * of_bulk3;
    of_mu += 2.0 * of_bulk3;
    out.friction_angle = of_phi * std::numbers::pi / 180.0;
  }
  out.youngs_modulus = (of_lambda * lambda + of_mu * mu) / e;
  const double shear = 1.0 + nu;
  const double bulk = 1.0 - 2.0 * nu;
  out.poisson_ratio = of_lambda * e * (1.0 + 2.0 * nu * nu) / (shear * shear * bulk * bulk) -
                      of_mu * e / (2.0 * shear * shear);
  const LawTraits& law = m.traits();
  if (law.uses("yield_stress")) {
    out.yield_stress = std::sqrt(2.0 / 3.0) * c.yield;
    out.hardening = c.hardening;
  }
  if (law.uses("viscosity")) out.viscosity = (m.law == Law::kHerschelBulkley ? 2.0 : 1.0) * c.eta;
  if (law.uses("exponent")) out.exponent = c.exponent;
  if (m.law == Law::kLatent) out.latent = latent_gradient(m, out);
  return out;
}

MaxwellBranch maxwell_gradient(const MaxwellBranch& branch, double dt, double stiffness,
                               double relaxed) {
  const double a = dt / branch.time;
  const double left = std::exp(-a);
  const double share = -std::expm1(-a);
  // (1 − e^(−a))/a has the derivative −slope; its two terms nearly cancel where a is small.
  const double slope = a < 1e-3 ? 0.5 - a / 3.0 + a * a / 8.0 : (share - a * left) / (a * a);
  const double of_a = left * relaxed - branch.modulus * slope * stiffness;
  return {share / a * stiffness, -a / branch.time * of_a};
}

}  // namespace matterfit::material
