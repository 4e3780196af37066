// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/contact_law.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace matterfit::mpm {
namespace {

/// Penetration, as a share of the body's size, at which a default spring is twice as stiff. What it
/// holds: docs/validation.md.
constexpr double kFirmAt = 0.05;

/// A liquid has no size of its own once it is poured, and its modulus is chosen low: with a cell of
/// it as a spring two metres of water sank in by 22 cm. A quarter of a cell: 13 cm, less than a
/// particle separation, for a third more substeps.
constexpr double kOfLiquid = 4.0;

/// The modulus that default contacts follow [Pa].
double contact_modulus(const Body& body) {
  const double modulus = body.material.p_wave_modulus();
  if (body.material.traits().fluid) return modulus;
  return std::min(modulus, 4.0 * body.material.mu());
}

double size_of(const Body& body) {
  double volume = 0.0;
  for (const double v : body.volumes) volume += v;
  return std::cbrt(6.0 * volume / std::numbers::pi);  // of the ball of equal volume
}

}  // namespace

ContactPoint contact_point(const shape::SurfacePoint& surface, const Mat3d& f, double volume,
                           double density, const Vec3d& velocity) {
  const double edge = std::cbrt(volume);
  const double stretch = (f.transpose() * surface.normal).norm();
  ContactPoint point;
  point.distance = surface.distance;
  point.radius = 0.5 * edge * stretch;
  point.area = f.determinant() * volume / (edge * stretch);
  point.mass = density * volume;
  point.normal = surface.normal;
  point.relative_velocity = velocity - surface.velocity;
  return point;
}

double contact_free_time(double gap, double speed, double acceleration, double frame_seconds,
                         bool animated) {
  const double horizon = frame_seconds / (animated ? 64.0 : 4.0);
  const double fastest = 2.0 * speed + 2.0 * acceleration * horizon + 1e-9;
  return std::min(horizon, 0.5 * gap / fastest);
}

Vec3d contact_force(const ContactLaw& law, const ContactPoint& point, std::int32_t surface,
                    double dt, ContactMemory& memory) {
  const double depth = point.radius - point.distance;
  const bool separates = shape::may_lift_off(law.kind);
  const bool held = memory.surface == surface;
  if (depth <= 0.0 && (separates || !held)) {
    if (held) memory = {};
    return Vec3d::Zero();
  }
  if (!held) {
    memory.surface = surface;
    memory.stretch = {};
  }
  // An inverted particle has no area; the body's own check reports it.
  const double spring = law.stiffness * std::max(point.area, 0.0);
  const double dashpot = 2.0 * law.damping * std::sqrt(spring * point.mass);
  const double approach = -point.normal.dot(point.relative_velocity);
  double normal_force = spring * depth * firmness_at(law, depth).secant + dashpot * approach;
  if (separates) normal_force = std::max(normal_force, 0.0);
  Vec3d force = normal_force * point.normal;
  if (!shape::resists_sliding(law.kind)) return force;

  const Vec3d sliding = point.relative_velocity + approach * point.normal;
  Vec3d stretch = Eigen::Map<const Vec3d>(memory.stretch.data()) + dt * sliding;
  stretch -= point.normal.dot(stretch) * point.normal;
  Vec3d tangential = -spring * stretch - dashpot * sliding;
  if (law.kind == shape::ContactKind::kFriction) {
    const double most = law.mu * normal_force;
    const double size = tangential.norm();
    if (size > most) {
      tangential *= size > 0.0 ? most / size : 0.0;
      // The spring keeps what it can carry, so that reversal starts from there.
      stretch = -tangential / spring;
    }
  }
  Eigen::Map<Vec3d>(memory.stretch.data()) = stretch;
  return force + tangential;
}

Firmness firmness_at(const ContactLaw& law, double depth) {
  if (!(law.firm_at > 0.0) || depth <= 0.0) return {};
  const double ratio = depth / law.firm_at;
  const double growth = ratio * ratio * ratio * ratio;
  return {1.0 + growth, 1.0 + 5.0 * growth};
}

double firmness(const ContactLaw& law, double pressure) {
  if (!(law.firm_at > 0.0)) return 1.0;
  // δ + δ⁵ = q in units of δ₁, from above.
  const double q = pressure / (law.stiffness * law.firm_at);
  return firmness_at(law, law.firm_at * std::min(q, std::pow(q, 0.2))).tangent;
}

double meeting_pressure(const Body& body, double speed, double pull) {
  return std::sqrt(body.density * contact_modulus(body)) * speed +
         2.0 * body.density * pull * size_of(body);
}

ContactLaw resolve_contact(const shape::Contact& contact, const Body& body, double dx) {
  ContactLaw law;
  law.kind = contact.kind;
  law.mu = contact.mu;
  law.damping = contact_damping(contact);
  law.stiffness = contact.stiffness;
  if (!(law.stiffness > 0.0)) {
    const double modulus = contact_modulus(body);
    const double size = size_of(body);
    if (body.material.traits().fluid) {
      law.stiffness = kOfLiquid * modulus / dx;
    } else {
      law.stiffness = std::min(8.0 * modulus / size, modulus / dx);
    }
    if (body.material.traits().elastic()) law.firm_at = kFirmAt * size;
  }
  return law;
}

}  // namespace matterfit::mpm
