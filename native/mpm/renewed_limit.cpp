// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_limit.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace matterfit::mpm {

template <class S>
std::pair<double, std::string> renewed_limit(const Scene& scene,
                                             const std::vector<RenewedBody<S>>& bodies,
                                             const std::vector<RenewedContact<S>>& contacts,
                                             const RenewedTerms<S>& terms, double min_j,
                                             double speed) {
  const double dx = scene.dx;
  double best = std::numeric_limits<double>::infinity();
  std::string reason;
  const auto limit = [&](double dt, const std::string& why) {
    if (dt < best) {
      best = dt;
      reason = why;
    }
  };
  for (std::size_t m = 0; m < bodies.size(); ++m) {
    const RenewedBody<S>& body = bodies[m];
    const material::Material& material = body.material();
    const bool newtonian = body.is_fluid();
    // Tangent of (K/7)(J − J⁻⁶) against K.
    const double stiffening =
        newtonian ? (1.0 + 6.0 * std::pow(std::clamp(min_j, 0.3, 1.0), -7.0)) / 7.0 : 1.0;
    double c = material.wave_speed(body.density()) * std::sqrt(stiffening);
    if (const double more = terms.of(m).modulus_bound(); more > 0.0) {
      c = std::sqrt(c * c + more / body.density());
    }
    const double elastic = c / (0.5 * dx);
    double contact = 0.0;
    for (const ContactLaw& law : contacts[m].laws()) {
      contact = std::max(contact, law.stiffness / (body.density() * 0.5 * dx));
    }
    limit(1.0 / std::sqrt(elastic * elastic + 0.5 * contact),
          (contact > elastic * elastic ? "contact of " : "elastic wave of ") + body.name());
    double viscosity = 2.0 * material.damping_shear + material.damping_bulk;
    if (newtonian) viscosity += 2.0 * material.viscosity;
    if (viscosity > 0.0) {
      limit(0.15 * body.density() * dx * dx / viscosity, "viscosity of " + body.name());
    }
  }
  for (std::size_t m = 0; m < bodies.size(); ++m) {
    const double drag = terms.of(m).rate_bound(speed);
    if (drag > 0.0) limit(1.0 / drag, "drag of " + bodies[m].name());
  }
  if (speed > 0.0) limit(scene.cfl * dx / speed, "CFL");
  return {best, reason};
}

template std::pair<double, std::string> renewed_limit<float>(
    const Scene&, const std::vector<RenewedBody<float>>&, const std::vector<RenewedContact<float>>&,
    const RenewedTerms<float>&, double, double);
template std::pair<double, std::string> renewed_limit<double>(
    const Scene&, const std::vector<RenewedBody<double>>&,
    const std::vector<RenewedContact<double>>&, const RenewedTerms<double>&, double, double);

}  // namespace matterfit::mpm
