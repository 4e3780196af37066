// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_touch_adjoint.hpp"

#include <Eigen/LU>

#include "mpm/contact_law_adjoint.hpp"

namespace matterfit::mpm {
namespace {

/// Cotangents of a force that the nodes share.
struct SharedForceBar {
  Vec3d force = Vec3d::Zero();
  Vec3d place = Vec3d::Zero();  ///< [cells]
  Vec3d normal = Vec3d::Zero();
  Vec3d face = Vec3d::Zero();  ///< [m]
};

/// All of it at the particle's centre; of what wets the tangential part at its face.
template <class S>
SharedForceBar shared_force_adjoint(const UpdatedPlace<S>& place, bool wets, const Vec3d& n,
                                    const Vec3d& face, const Vec3d& force,
                                    const BlockField& force_bar, double dx) {
  SharedForceBar bar;
  const BlockField::Stencil center = block_stencil(place, dx);
  const Vec3d at_center = force_bar.at(center);
  if (!wets) {
    bar.force = at_center;
    bar.place = dx * (force_bar.gradient(center).transpose() * force);
    return bar;
  }
  const double along = n.dot(force);
  const Vec3d tangential = force - along * n;
  S offset[3];
  for (int a = 0; a < 3; ++a) offset[a] = static_cast<S>(face[a] / dx);
  const OffsetPlace<S> on_face(place, offset);
  UpdatedPlace<S> there = place;
  for (int a = 0; a < 3; ++a) there.f[a] = on_face.f[a];
  const BlockField::Stencil at = block_stencil(there, dx);
  const Vec3d at_face = force_bar.at(at);
  const Vec3d difference = at_center - at_face;
  bar.force = at_face + n.dot(difference) * n;
  bar.normal = along * difference + n.dot(difference) * force;
  bar.place = dx * (force_bar.gradient(center).transpose() * (along * n));
  Vec3d offset_bar = Vec3d::Zero();
  on_face.back(offset, dx * (force_bar.gradient(at).transpose() * tangential), bar.place,
               offset_bar);
  bar.face = offset_bar / dx;
  return bar;
}

}  // namespace

template <class S>
RenewedTouchBar renewed_touch_adjoint(const RenewedSkin& skin, const shape::Collider& collider,
                                      const ContactLaw& law, const RenewedTouch& touch,
                                      const RenewedSubstep& substep, const UpdatedPlace<S>& place,
                                      double volume, const Mat3d& elastic,
                                      const RenewedMotion& motion, const BlockField& force_bar,
                                      double dx, const Vec3d& stretch_bar) {
  // Forward again.
  const auto id = static_cast<std::int32_t>(touch.collider);
  const shape::SurfacePoint surface = collider.closest(motion.position, substep.time);
  const Mat3d moved = Mat3d::Identity() + motion.gradient;
  const Mat3d f = moved * elastic;
  ContactPoint point = contact_point(surface, f, volume, skin.density, motion.velocity);
  const Vec3d& n = point.normal;
  const bool faces = skin.wets && (point.distance < point.radius || touch.memory.surface == id);
  Mat3d inverse = Mat3d::Zero();
  Vec3d face = Vec3d::Zero();
  if (faces) {
    inverse = moved.inverse();
    face = inverse * (-point.radius * n);
    point.relative_velocity += motion.rate * face;
  }
  ContactMemory after = touch.memory;
  const Vec3d force = contact_force(law, point, id, substep.dt, after);

  SharedForceBar shared;
  if (!force.isZero(0.0)) {
    shared = shared_force_adjoint(place, skin.wets, n, face, force, force_bar, dx);
  }
  ContactCotangents c =
      contact_force_adjoint(law, point, id, substep.dt, touch.memory, shared.force, stretch_bar);
  RenewedTouchBar bar;
  bar.place = shared.place;
  bar.stretch = c.stretch;
  bar.collider.mu = c.mu;
  bar.collider.stiffness = c.stiffness;
  bar.collider.damping = c.damping;
  c.normal += shared.normal;
  if (faces) {
    bar.motion.rate = c.relative_velocity * face.transpose();
    const Vec3d face_bar = shared.face + motion.rate.transpose() * c.relative_velocity;
    const Vec3d reach_bar = inverse.transpose() * face_bar;  // of −r n
    c.radius -= n.dot(reach_bar);
    c.normal -= point.radius * reach_bar;
    bar.motion.gradient = -reach_bar * face.transpose();
  }
  const ContactPointCotangents p = contact_point_adjoint(n, f, volume, c);
  bar.log_density = skin.density * p.density;
  bar.motion.position =
      back_to_surface(collider, motion.position, substep.time, shape::kColliderProbe * dx, surface,
                      c.distance, c.normal + p.normal, -c.relative_velocity, bar.collider);
  bar.motion.velocity = c.relative_velocity;
  bar.motion.gradient += p.deformation_gradient * elastic.transpose();
  bar.elastic = moved.transpose() * p.deformation_gradient;
  return bar;
}

template RenewedTouchBar renewed_touch_adjoint<float>(const RenewedSkin&, const shape::Collider&,
                                                      const ContactLaw&, const RenewedTouch&,
                                                      const RenewedSubstep&,
                                                      const UpdatedPlace<float>&, double,
                                                      const Mat3d&, const RenewedMotion&,
                                                      const BlockField&, double, const Vec3d&);
template RenewedTouchBar renewed_touch_adjoint<double>(const RenewedSkin&, const shape::Collider&,
                                                       const ContactLaw&, const RenewedTouch&,
                                                       const RenewedSubstep&,
                                                       const UpdatedPlace<double>&, double,
                                                       const Mat3d&, const RenewedMotion&,
                                                       const BlockField&, double, const Vec3d&);

}  // namespace matterfit::mpm
