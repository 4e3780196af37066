// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/step_limit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "job/fit_contacts.hpp"
#include "mpm/contact_law.hpp"

namespace matterfit::job {

double step_limit(const mpm::Scene& scene, const mpm::Body& body) {
  double contact = 0.0;
  for (const double stiffness : contact_stiffnesses(scene, body)) {
    contact = std::max(contact, stiffness);
  }
  for (const mpm::BodyContact& pair : scene.contacts) {
    contact = std::max(contact, mpm::resolve_contact(pair.contact, body, scene.dx).stiffness);
  }
  constexpr double kCell = 13.3;
  const material::Material& m = body.material;
  const double per_modulus = kCell / (body.density * scene.dx * scene.dx);
  const double omega =
      std::sqrt(per_modulus * m.p_wave_modulus() + 2.0 * contact / (body.density * scene.dx));
  double viscous = 2.0 * m.damping_shear + m.damping_bulk;
  if (m.law == material::Law::kNewtonian) viscous += 2.0 * m.viscosity;
  const double xi = 0.5 * per_modulus * viscous / omega;
  return 2.0 / omega * (std::sqrt(1.0 + xi * xi) - xi);
}

double step_limit(const mpm::Scene& scene) {
  double least = std::numeric_limits<double>::infinity();
  for (const mpm::Body& body : scene.bodies) least = std::min(least, step_limit(scene, body));
  return least;
}

}  // namespace matterfit::job
