// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/step_limit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mpm/body_terms.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/default_stiffness.hpp"

namespace matterfit::mpm {

double step_limit(const Scene& scene, const Body& body) {
  double contact = 0.0;
  for (const double stiffness : contact_stiffnesses(scene, body)) {
    contact = std::max(contact, stiffness);
  }
  for (const BodyContact& pair : scene.contacts) {
    contact = std::max(contact, resolve_contact(pair.contact, body, scene.dx).stiffness);
  }
  constexpr double kCell = 13.3;
  const material::Material& m = body.material;
  const double per_modulus = kCell / (body.density * scene.dx * scene.dx);
  double modulus = m.stiffest_modulus();
  if (!scene.effects.empty() || !m.correction.empty()) {
    modulus += BodyTerms(scene, body).modulus_bound();
  }
  const double omega = std::sqrt(per_modulus * modulus + 2.0 * contact / (body.density * scene.dx));
  double viscous = 2.0 * m.damping_shear + m.damping_bulk;
  if (m.traits().fluid) viscous += 2.0 * m.viscosity;
  const double xi = 0.5 * per_modulus * viscous / omega;
  return 2.0 / omega * (std::sqrt(1.0 + xi * xi) - xi);
}

double step_limit(const Scene& scene) {
  double least = std::numeric_limits<double>::infinity();
  for (const Body& body : scene.bodies) least = std::min(least, step_limit(scene, body));
  return least;
}

}  // namespace matterfit::mpm
