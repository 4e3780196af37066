// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>

#include "base/vec.hpp"
#include "mpm/scene.hpp"
#include "shape/collider.hpp"

namespace matterfit::mpm {

/// Contact of particles with surfaces, accurate below the cell: a penalty on the exact distance,
///   f_n = k A δ (1 + (δ/δ₁)⁴) − damping,  δ = ⟨r − d⟩,  A = J V/(2r₀),  r = r₀ √(nᵀ F Fᵀ n),
/// d the distance of the particle's centre; where the body has a field of displacements (total
/// Lagrangian) gap and force are those of the face itself, r = 0.
/// k [Pa/m] a property of the contact (a skin's compliance), so that results converge with dx; it
/// is linear where it is given (δ₁ infinite), and where it is the default it grows with depth, so
/// that neither weight nor impact lets a body sink by a tenth of its size (resolve_contact()).
/// Friction is a tangential spring with memory, capped at μ f_n: it sticks without creeping. `glue`
/// and `no_slip` have the spring without a cap; `glue` keeps it, and pulls, once it was touched.
struct ContactLaw {
  shape::ContactKind kind = shape::ContactKind::kFriction;
  double mu = 0.0;
  double stiffness = 0.0;  ///< [Pa/m]
  double damping = 0.0;    ///< fraction of critical, of the particle on its spring
  double firm_at = 0.0;    ///< δ₁ [m], where the spring is twice as stiff; 0: nowhere
};

/// What a particle remembers of the surface it touches. No padding: it is saved as bytes.
struct ContactMemory {
  std::array<double, 3> stretch{};  ///< of the tangential spring, world axes [m]
  std::int32_t surface = -1;        ///< index of the surface, −1: none
  std::int32_t unused = 0;
};

/// One particle at one surface.
struct ContactPoint {
  double distance = 0.0;  ///< of the particle's centre, signed [m]
  double radius = 0.0;    ///< present half-size along the normal [m]
  double area = 0.0;      ///< [m²]
  double mass = 0.0;      ///< [kg]
  Vec3d normal = Vec3d::UnitZ();
  Vec3d relative_velocity = Vec3d::Zero();  ///< of the particle against the surface [m/s]
};

/// The particle with rest volume `volume` [m³] and deformation gradient `f` at `surface`.
[[nodiscard]] ContactPoint contact_point(const shape::SurfacePoint& surface, const Mat3d& f,
                                         double volume, double density, const Vec3d& velocity);

/// How long [s] nothing can close `gap` [m]: at twice its present speed and accelerated by twice
/// `acceleration`, and a quarter of a frame at most; a 64th where a collider is animated, whose
/// speed may be another one soon.
[[nodiscard]] double contact_free_time(double gap, double speed, double acceleration,
                                       double frame_seconds, bool animated);

/// Force on the particle [N]; updates its memory over `dt`.
[[nodiscard]] Vec3d contact_force(const ContactLaw& law, const ContactPoint& point,
                                  std::int32_t surface, double dt, ContactMemory& memory);

/// The normal spring of the law as multiples of `stiffness`.
struct Firmness {
  double secant = 1.0;   ///< force over depth, 1 + (δ/δ₁)⁴
  double tangent = 1.0;  ///< slope of the force, 1 + 5 (δ/δ₁)⁴
};

/// At `depth` δ [m].
[[nodiscard]] Firmness firmness_at(const ContactLaw& law, double depth);

/// How many times `stiffness` the tangent of the normal spring is where it carries `pressure`
/// [Pa], at least nearly; 1 of a linear one.
[[nodiscard]] double firmness(const ContactLaw& law, double pressure);

/// The pressure [Pa] with which a body at `speed` [m/s] meets a wall, ρ c v with c the wave speed
/// by which defaults go (of resolve_contact()'s M), and that of its own weight under `pull` [m/s²].
[[nodiscard]] double meeting_pressure(const Body& body, double speed, double pull);

/// Fills in the defaults: stiffness 8 M/size, at most M/dx, with M = λ+2μ, of a solid at most 4μ,
/// of a liquid 4 M/dx; of an elastic body it doubles at a depth of a 20th of the size. The size is
/// the diameter of the ball of equal volume.
[[nodiscard]] ContactLaw resolve_contact(const shape::Contact& contact, const Body& body,
                                         double dx);

/// Default damping, as a fraction of critical of a particle on its spring: takes the edge off the
/// chatter of single particles. The spread of a rebound over sub-cell offsets does not need it
/// (docs/validation.md).
inline constexpr double kContactDamping = 0.05;

/// A contact's own, else the default.
[[nodiscard]] inline double contact_damping(const shape::Contact& contact) {
  return contact.damping >= 0.0 ? contact.damping : kContactDamping;
}

}  // namespace matterfit::mpm
