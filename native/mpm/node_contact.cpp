// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/node_contact.hpp"

#include <cmath>

#include "mpm/layout.hpp"

namespace matterfit::mpm {

Vec3d position_of_node(const Vec3d& origin, double dx, std::size_t n) {
  const std::size_t x = n / 16;
  const std::size_t y = n / 4 % 4;
  return origin +
         dx * Vec3d(static_cast<double>(x), static_cast<double>(y), static_cast<double>(n % 4));
}

bool reaches_nodes(const shape::Collider& collider, const Vec3d& origin, double dx, double time) {
  const Vec3d middle = origin + Vec3d::Constant(1.5 * dx);
  const double reach = 1.5 * dx * std::sqrt(3.0);
  return collider.closest(middle, time).distance <= reach + kNodeInside * dx;
}

Vec3d node_response(const shape::Contact& contact, const shape::SurfacePoint& surface,
                    const Vec3d& velocity) {
  Vec3d v = velocity - surface.velocity;
  const double normal = surface.normal.dot(v);
  const Vec3d tangential = v - normal * surface.normal;
  switch (contact.kind) {
    case shape::ContactKind::kGlue:
      v.setZero();
      break;
    case shape::ContactKind::kNoSlip:
      if (normal < 0.0) v.setZero();
      break;
    case shape::ContactKind::kSlip:
      v = tangential;
      break;
    case shape::ContactKind::kSeparating:
      if (normal < 0.0) v = tangential;
      break;
    case shape::ContactKind::kFriction:
      if (normal < 0.0) {
        const double speed = tangential.norm();
        const double kept = speed + contact.mu * normal;
        v = kept > 0.0 ? Vec3d(tangential * (kept / speed)) : Vec3d::Zero();
      }
      break;
  }
  return v + surface.velocity;
}

template <class S>
void apply_node_contact(const shape::Collider& collider, const Vec3d& origin, double dx,
                        double time, const S* mass, S* velocity) {
  if (!reaches_nodes(collider, origin, dx, time)) return;
  const shape::Contact& contact = collider.contact();
  for (std::size_t n = 0; n < kBlockNodes; ++n) {
    if (!(mass[n] > S(0))) continue;
    const Vec3d node = position_of_node(origin, dx, n);
    const shape::SurfacePoint surface = collider.closest(node, time);
    if (surface.distance > kNodeInside * dx) continue;
    Vec3d v(static_cast<double>(velocity[n]), static_cast<double>(velocity[kBlockNodes + n]),
            static_cast<double>(velocity[2 * kBlockNodes + n]));
    v = node_response(contact, surface, v);
    for (std::size_t c = 0; c < 3; ++c) {
      velocity[c * kBlockNodes + n] = static_cast<S>(v[static_cast<int>(c)]);
    }
  }
}

template void apply_node_contact<float>(const shape::Collider&, const Vec3d&, double, double,
                                        const float*, float*);
template void apply_node_contact<double>(const shape::Collider&, const Vec3d&, double, double,
                                         const double*, double*);

}  // namespace matterfit::mpm
