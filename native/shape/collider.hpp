// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "base/vec.hpp"
#include "shape/keyed.hpp"

namespace matterfit::shape {

enum class ContactKind {
  kGlue,        ///< no motion relative to the surface, in any direction, once it was touched
  kSlip,        ///< no normal motion, either way; tangential motion is free
  kSeparating,  ///< may lift off; no friction
  kFriction,    ///< may lift off; Coulomb friction `mu`
  kNoSlip,      ///< may lift off; no tangential motion while it is pressed
};

/// Whether a body may leave a surface that it has touched.
[[nodiscard]] constexpr bool may_lift_off(ContactKind kind) {
  return kind != ContactKind::kGlue && kind != ContactKind::kSlip;
}

/// Whether a surface resists motion along it.
[[nodiscard]] constexpr bool resists_sliding(ContactKind kind) {
  return kind != ContactKind::kSlip && kind != ContactKind::kSeparating;
}

enum class ContactMethod {
  kAuto,      ///< particle
  kParticle,  ///< forces on particles against the exact distance: accurate below the cell
  kNode,      ///< velocities of grid nodes: the usual way, for parity with other MPM codes
};

/// How a body touches a surface or another body.
struct Contact {
  ContactKind kind = ContactKind::kFriction;
  double mu = 0.4;         ///< Coulomb coefficient
  double stiffness = 0.0;  ///< [Pa/m]; 0: 8 (λ+2μ)/body size, resolved once
  double damping = -1.0;   ///< fraction of critical; negative: the solver's default
  ContactMethod method = ContactMethod::kAuto;
};

/// The surface seen from a point.
struct SurfacePoint {
  double distance = 1e30;          ///< signed, negative inside, [m]
  Vec3d normal = Vec3d::UnitZ();   ///< unit, out of the collider
  Vec3d velocity = Vec3d::Zero();  ///< of the surface there, [m/s]
};

/// Anything that a body can run into. Immutable: safe to query from any thread.
/// Times are seconds after the scene's first frame; positions are in world space, metres.
class Collider {
 public:
  Collider(std::string name, Contact contact) : name_(std::move(name)), contact_(contact) {}
  virtual ~Collider() = default;
  Collider(const Collider&) = delete;
  Collider& operator=(const Collider&) = delete;

  /// Exact wherever |distance| < band(); beyond, `distance` is a lower bound of its magnitude.
  [[nodiscard]] virtual SurfacePoint closest(const Vec3d& position, double time) const = 0;
  /// Distances are exact up to this far from the surface [m]; infinity for analytic shapes.
  [[nodiscard]] virtual double band() const = 0;

  /// True if its surface moves at any time.
  [[nodiscard]] virtual bool animated() const = 0;

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const Contact& contact() const { return contact_; }

 private:
  std::string name_;
  Contact contact_;
};

using ColliderPtr = std::shared_ptr<const Collider>;

/// Half-space behind the plane through `point`; `normal` points into the free side. `pose` moves
/// it.
[[nodiscard]] ColliderPtr make_plane(std::string name, Contact contact, const Vec3d& point,
                                     const Vec3d& normal, Keyed<Pose> pose = Keyed<Pose>(Pose{}));
/// Centre at the pose's position, `radius` [m].
[[nodiscard]] ColliderPtr make_sphere(std::string name, Contact contact, double radius,
                                      Keyed<Pose> pose);
/// Half extents [m] along the pose's axes.
[[nodiscard]] ColliderPtr make_box(std::string name, Contact contact, const Vec3d& half_extents,
                                   Keyed<Pose> pose);
/// A capsule along the pose's z axis: a cylinder of half length `half_length` with round ends.
[[nodiscard]] ColliderPtr make_capsule(std::string name, Contact contact, double radius,
                                       double half_length, Keyed<Pose> pose);

}  // namespace matterfit::shape
