// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mpm/contact_law.hpp"
#include "mpm/renewed_back.hpp"
#include "shape/collider_adjoint.hpp"

namespace matterfit::mpm {

/// A renewed body as its contact knows it.
struct RenewedSkin {
  double density;
  bool fluid;  ///< RenewedBody::is_fluid
  bool wets;
};

/// What comes back through one touch, beside the motion of the particle.
struct RenewedTouchBar {
  RenewedMotion motion;
  Vec3d place = Vec3d::Zero();  ///< by the weights that share the force out [cells]
  Mat3d elastic = Mat3d::Zero();
  Vec3d stretch = Vec3d::Zero();  ///< of the memory before
  double log_density = 0.0;
  shape::ColliderCotangents collider;
};

/// The adjoint of what RenewedContact::apply does with one particle at one collider. `force_bar`:
/// cotangents of the node forces of its block; `stretch_bar` that of the memory after.
template <class S>
[[nodiscard]] RenewedTouchBar renewed_touch_adjoint(
    const RenewedSkin& skin, const shape::Collider& collider, const ContactLaw& law,
    const RenewedTouch& touch, const RenewedSubstep& substep, const UpdatedPlace<S>& place,
    double volume, const Mat3d& elastic, const RenewedMotion& motion, const BlockField& force_bar,
    double dx, const Vec3d& stretch_bar);

}  // namespace matterfit::mpm
