// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/classical/law_constants.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "material/neural/isotropic_material.hpp"

namespace matterfit::material {

template <class S>
LawConstants<S> law_constants(const Material& m) {
  LawConstants<S> c;
  const double lambda = m.lambda();
  const double mu = m.traits().fluid ? 0.0 : m.youngs_modulus / (2.0 * (1.0 + m.poisson_ratio));
  c.law = is_isotropic(m.law) ? Law::kNeuralIsotropic : m.law;
  c.lambda = static_cast<S>(lambda);
  c.mu = static_cast<S>(mu);
  c.kappa = static_cast<S>(m.traits().fluid ? m.bulk_modulus : lambda + 2.0 / 3.0 * mu);
  c.split = m.law == Law::kNeoHookean && m.poisson_ratio >= kSplitPoissonRatio;
  c.yield = static_cast<S>(std::sqrt(2.0 / 3.0) * m.yield_stress);
  c.hardening = static_cast<S>(m.hardening);
  c.eta = static_cast<S>(m.law == Law::kHerschelBulkley ? 2.0 * m.viscosity : m.viscosity);
  c.exponent = static_cast<S>(m.exponent);
  if (m.law == Law::kDruckerPrager) {
    const double phi = m.friction_angle * std::numbers::pi / 180.0;
    const double bulk3 = 3.0 * lambda + 2.0 * mu;
    const double scale = std::sqrt(2.0 / 3.0) * 2.0 / (3.0 - std::sin(phi));
    c.alpha = static_cast<S>(scale * std::sin(phi));
    c.alpha_tip = static_cast<S>(scale * m.cohesion * std::cos(phi) / bulk3);
    // A strain of one is far beyond any cohesive solid: the tip of a cylinder (φ → 0) is not met.
    const double tip = phi > 0.0 ? m.cohesion / (std::tan(phi) * bulk3) : 1.0;
    c.tip = static_cast<S>(m.cohesion > 0.0 ? std::min(tip, 1.0) : 0.0);
  }
  if (is_isotropic(m.law)) {
    IsotropicConstants<double> from = isotropic_constants(m);
    std::array<double, kIsotropicWeights> entries{};
    std::size_t i = 0;
    from.for_each([&](double entry) { entries[i++] = entry; });
    i = 0;
    c.neural.for_each([&](S& entry) { entry = static_cast<S>(entries[i++]); });
  }
  c.damping_shear = static_cast<S>(m.damping_shear);
  c.damping_bulk = static_cast<S>(m.damping_bulk);
  for (const MaxwellBranch& branch : m.maxwell) {
    c.maxwell[c.maxwell_count++] = {static_cast<S>(branch.modulus), static_cast<S>(branch.time)};
  }
  c.damped =
      m.damping_shear > 0.0 || m.damping_bulk > 0.0 || (m.traits().fluid && m.viscosity > 0.0);
  c.plastic = m.traits().plastic;
  c.fluid = m.traits().fluid;
  c.own_volume = !m.traits().mean_dilatation;
  return c;
}

template LawConstants<float> law_constants<float>(const Material& material);
template LawConstants<double> law_constants<double>(const Material& material);

}  // namespace matterfit::material
