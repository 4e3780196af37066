// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_limit.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "material/neural/published_weights.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/updated_contact.hpp"

namespace matterfit::mpm {

template <class S>
std::pair<double, std::string> updated_limit(const Scene& scene,
                                             const std::vector<UpdatedMember<S>>& members,
                                             const UpdatedTerms<S>& terms, double min_j,
                                             double max_speed, double pull) {
  const double dx = scene.dx;
  const double frame_seconds = 1.0 / scene.fps;
  double best = std::numeric_limits<double>::infinity();
  std::string reason;
  const auto limit = [&](double dt, const std::string& why) {
    if (dt < best) {
      best = dt;
      reason = why;
    }
  };
  for (const UpdatedMember<S>& m : members) {
    double stiffening = 1.0;
    if (m.material.traits().fluid) {
      // Tangent of (K/7)(J − J⁻⁶) against K.
      stiffening = (1.0 + 6.0 * std::pow(std::clamp(min_j, 0.3, 1.0), -7.0)) / 7.0;
    }
    double c = m.material.wave_speed(m.density) * std::sqrt(stiffening);
    const BodyTerms& acting = terms.of(static_cast<std::size_t>(&m - members.data()));
    if (const double more = acting.modulus_bound(); more > 0.0) {
      c = std::sqrt(c * c + more / m.density);
    }
    double rate = c / (0.5 * dx);
    double contact = 0.0;
    for (const ContactLaw& law : m.contacts) {
      const double pressure =
          meeting_pressure(scene.bodies[m.index], max_speed + pull * frame_seconds, pull);
      contact = std::max(contact, law.stiffness * firmness(law, pressure) / (m.density * 0.5 * dx));
    }
    rate = std::sqrt(rate * rate + 0.5 * contact);
    // A longer one would overshoot what the plastic net was trained to take away at once.
    if (m.material.published) {
      limit(material::kPublishedSubstep / scene.dt_safety,
            "the substep that " + m.name + " learned");
    }
    limit(1.0 / rate, (contact > rate * rate ? "contact of " : "elastic wave of ") + m.name);
    double viscosity = 2.0 * m.material.damping_shear + m.material.damping_bulk;
    if (m.material.traits().fluid) viscosity += 2.0 * m.material.viscosity;
    if (viscosity > 0.0) {
      limit(0.15 * m.density * dx * dx / viscosity, "viscosity of " + m.name);
    }
  }
  const double speed = max_speed + pull * frame_seconds;
  for (std::size_t m = 0; m < members.size(); ++m) {
    terms.of(m).check_step(speed);
    const double drag = terms.of(m).rate_bound(speed);
    if (drag > 0.0) limit(1.0 / drag, "drag of " + members[m].name);
  }
  if (speed > 0.0) limit(scene.cfl * dx / speed, "CFL");
  return {best, reason};
}

template std::pair<double, std::string> updated_limit<float>(
    const Scene&, const std::vector<UpdatedMember<float>>&, const UpdatedTerms<float>&, double,
    double, double);
template std::pair<double, std::string> updated_limit<double>(
    const Scene&, const std::vector<UpdatedMember<double>>&, const UpdatedTerms<double>&, double,
    double, double);

}  // namespace matterfit::mpm
