// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/vec.hpp"
#include "mpm/contact_law.hpp"

namespace matterfit::mpm {

/// Derivatives of one number with respect to what contact_point() and contact_force() take.
struct ContactCotangents {
  double distance = 0.0;
  double radius = 0.0;
  double area = 0.0;
  double mass = 0.0;
  Vec3d normal = Vec3d::Zero();
  Vec3d relative_velocity = Vec3d::Zero();
  Vec3d stretch = Vec3d::Zero();  ///< of the memory before
  double mu = 0.0;
  double stiffness = 0.0;
  double damping = 0.0;
};

/// Adjoint of contact_force(): `memory` is the one before; `force_bar` and `stretch_bar` are the
/// cotangents of the force and of the memory after. Where contact begins, ends, or starts to slide,
/// the side of the forward pass counts.
[[nodiscard]] ContactCotangents contact_force_adjoint(
    const ContactLaw& law, const ContactPoint& point, std::int32_t surface, double dt,
    const ContactMemory& memory, const Vec3d& force_bar, const Vec3d& stretch_bar);

/// Adjoint of contact_point(): from the point's cotangents to those of the deformation gradient,
/// the surface's normal (in addition to `bar.normal`) and the density. Distance and velocities go
/// through as they are.
struct ContactPointCotangents {
  Mat3d deformation_gradient = Mat3d::Zero();
  Vec3d normal = Vec3d::Zero();
  double density = 0.0;
};
[[nodiscard]] ContactPointCotangents contact_point_adjoint(const Vec3d& normal, const Mat3d& f,
                                                           double volume,
                                                           const ContactCotangents& bar);

}  // namespace matterfit::mpm
