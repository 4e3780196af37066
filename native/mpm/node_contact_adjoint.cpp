// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/node_contact_adjoint.hpp"

#include <cstddef>

#include "mpm/layout.hpp"
#include "mpm/node_contact.hpp"

namespace matterfit::mpm {
namespace {

struct NodeCotangents {
  Vec3d velocity = Vec3d::Zero();  ///< of the node, before
  Vec3d normal = Vec3d::Zero();
  Vec3d surface_velocity = Vec3d::Zero();
  double mu = 0.0;
};

/// One node inside: `u` is its velocity against the surface, `after` the cotangent of its velocity.
NodeCotangents project_adjoint(const shape::Contact& contact, const Vec3d& n, const Vec3d& u,
                               const Vec3d& after) {
  NodeCotangents bar;
  const double along = n.dot(u);
  if (along >= 0.0 && shape::may_lift_off(contact.kind)) {
    bar.velocity = after;
    return bar;
  }
  const Vec3d tangential = u - along * n;
  Vec3d tangential_bar = after;
  double along_bar = 0.0;
  if (contact.kind == shape::ContactKind::kGlue || contact.kind == shape::ContactKind::kNoSlip) {
    tangential_bar.setZero();
  } else if (contact.kind == shape::ContactKind::kFriction) {
    const double speed = tangential.norm();
    if (speed + contact.mu * along > 0.0) {
      // t (1 + μ u_n/|t|).
      const double slide = after.dot(tangential) / speed;
      const double less = contact.mu * along / speed;
      tangential_bar = (1.0 + less) * after - less * slide / speed * tangential;
      along_bar = contact.mu * slide;
      bar.mu = along * slide;
    } else {
      tangential_bar.setZero();
    }
  }
  along_bar -= n.dot(tangential_bar);
  bar.normal = along_bar * u - along * tangential_bar;
  bar.velocity = tangential_bar + along_bar * n;
  bar.surface_velocity = after - bar.velocity;
  return bar;
}

/// A node inside a collider, and its velocity before that answers.
struct Meeting {
  std::size_t collider;
  shape::SurfacePoint surface;
  Vec3d before;
};

template <class Number>
Vec3d at_node(const Number* field, std::size_t n) {
  return {static_cast<double>(field[n]), static_cast<double>(field[kBlockNodes + n]),
          static_cast<double>(field[2 * kBlockNodes + n])};
}

}  // namespace

template <class S>
void node_contact_adjoint(const std::vector<shape::ColliderPtr>& colliders, const Vec3d& origin,
                          double dx, double time, const S* mass, const S* velocity,
                          double* velocity_bar, shape::ColliderCotangents* bars,
                          const double* displacement, double* displacement_bar) {
  std::vector<std::size_t> near;
  for (std::size_t c = 0; c < colliders.size(); ++c) {
    if (displacement != nullptr || reaches_nodes(*colliders[c], origin, dx, time)) {
      near.push_back(c);
    }
  }
  std::vector<Meeting> met;
  for (std::size_t n = 0; n < kBlockNodes && !near.empty(); ++n) {
    if (!(mass[n] > S(0))) continue;
    Vec3d node = position_of_node(origin, dx, n);
    if (displacement != nullptr) node += at_node(displacement, n);
    // As the forward pass rounds.
    Eigen::Matrix<S, 3, 1> v(velocity[n], velocity[kBlockNodes + n], velocity[2 * kBlockNodes + n]);
    met.clear();
    for (const std::size_t c : near) {
      const shape::SurfacePoint surface = colliders[c]->closest(node, time);
      if (surface.distance > kNodeInside * dx) continue;
      met.push_back({c, surface, v.template cast<double>()});
      v = node_response(colliders[c]->contact(), surface, met.back().before).template cast<S>();
    }
    while (!met.empty()) {
      const Meeting at = met.back();
      met.pop_back();
      const shape::Collider& collider = *colliders[at.collider];
      const NodeCotangents bar =
          project_adjoint(collider.contact(), at.surface.normal, at.before - at.surface.velocity,
                          at_node(velocity_bar, n));
      bars[at.collider].mu += bar.mu;
      const Vec3d x_bar =
          back_to_surface(collider, node, time, shape::kColliderProbe * dx, at.surface, 0.0,
                          bar.normal, bar.surface_velocity, bars[at.collider]);
      for (std::size_t k = 0; k < 3; ++k) {
        velocity_bar[k * kBlockNodes + n] = bar.velocity[static_cast<int>(k)];
        if (displacement_bar != nullptr) {
          displacement_bar[k * kBlockNodes + n] += x_bar[static_cast<int>(k)];
        }
      }
    }
  }
}

template void node_contact_adjoint<float>(const std::vector<shape::ColliderPtr>&, const Vec3d&,
                                          double, double, const float*, const float*, double*,
                                          shape::ColliderCotangents*, const double*, double*);
template void node_contact_adjoint<double>(const std::vector<shape::ColliderPtr>&, const Vec3d&,
                                           double, double, const double*, const double*, double*,
                                           shape::ColliderCotangents*, const double*, double*);

}  // namespace matterfit::mpm
