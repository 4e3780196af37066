// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_loads_adjoint.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "mpm/contact_law_adjoint.hpp"
#include "mpm/updated_pins.hpp"

namespace matterfit::mpm {
namespace {

/// Cotangents of the grid at a place: sums over its nodes, and how they change with the place.
struct GridSums {
  Vec3d momentum = Vec3d::Zero();
  double mass = 0.0;
  Mat3d momentum_by = Mat3d::Zero();  ///< ∂momentum/∂x [1/m]
  Vec3d mass_by = Vec3d::Zero();
};

template <class S>
Mat3d deformation_gradient_of(const S h[9]) {
  Mat3d f = Mat3d::Identity();
  for (int i = 0; i < 9; ++i) f(i / 3, i % 3) += static_cast<double>(h[i]);
  return f;
}

template <class S>
void add_to(const Vec3d& value, std::array<S, 3>& sum) {
  for (std::size_t c = 0; c < 3; ++c) sum[c] += static_cast<S>(value[static_cast<int>(c)]);
}

}  // namespace

/// What a substep's loads have in common.
template <class S>
struct UpdatedLoadsAdjoint<S>::Substep {
  const UpdatedRecord<S>* record;
  const std::vector<S>* nodes;
  const S* velocity;
  double dx;

  [[nodiscard]] Vec3d position(const UpdatedPlace<S>& place) const {
    const Vec3d origin = record->after->coordinates[place.block].template cast<double>() * (4 * dx);
    return place.position(origin, dx);
  }

  /// At the nodes of the place's cell, with the weights of `f`.
  [[nodiscard]] GridSums sums(const UpdatedPlace<S>& place, const Vec3d& f) const {
    GridSums out;
    const PointStencil s(f, dx);
    for_each_cotangent(
        *record->after, *nodes, place,
        [&](const Vec3d& momentum, double mass, std::size_t i, std::size_t j, std::size_t k) {
          const double w = s.weight(i, j, k);
          const Vec3d g = s.gradient(i, j, k);
          out.momentum += w * momentum;
          out.momentum_by += momentum * g.transpose();
          out.mass += w * mass;
          out.mass_by += mass * g;
        });
    return out;
  }

  /// Calls visit(first component's place in a velocity field, i, j, k) for the nodes that the grid
  /// had in the substep; the others were at rest.
  template <class Visit>
  void for_each_velocity(const UpdatedPlace<S>& place, const Visit& visit) const {
    place.for_each_node([&](std::size_t x, std::size_t y, std::size_t z, std::size_t i,
                            std::size_t j, std::size_t k) {
      const std::size_t block = record->after->neighbours[place.block][neighbour_of_node(x, y, z)];
      if (block >= record->before->coordinates.size()) return;
      visit(block * 3 * kBlockNodes + node_index(x % 4, y % 4, z % 4), i, j, k);
    });
  }
  [[nodiscard]] Vec3d node_velocity(std::size_t at) const {
    return {static_cast<double>(velocity[at]), static_cast<double>(velocity[at + kBlockNodes]),
            static_cast<double>(velocity[at + 2 * kBlockNodes])};
  }
  /// Σ v_I ∇w_I.
  [[nodiscard]] Mat3d velocity_gradient(const UpdatedPlace<S>& place, const PointStencil& s) const {
    Mat3d gradient = Mat3d::Zero();
    for_each_velocity(place, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
      gradient += node_velocity(node) * s.gradient(i, j, k).transpose();
    });
    return gradient;
  }
  /// From the cotangent of velocity_gradient() to those of the node velocities, which are made if
  /// there are none yet, and of the place.
  void velocity_gradient_adjoint(const UpdatedPlace<S>& place, const PointStencil& s,
                                 const Mat3d& gradient_bar, std::vector<double>& velocity_bar,
                                 Vec3d& x_bar) const {
    if (velocity_bar.empty()) {
      velocity_bar.assign(record->before->coordinates.size() * 3 * kBlockNodes, 0.0);
    }
    for_each_velocity(place, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
      const Vec3d bar = gradient_bar * s.gradient(i, j, k);
      for (std::size_t a = 0; a < 3; ++a) {
        velocity_bar[node + a * kBlockNodes] += bar[static_cast<int>(a)];
      }
      x_bar += s.curvature(i, j, k, dx) * (gradient_bar.transpose() * node_velocity(node));
    });
  }
};

namespace {

/// Cotangents of an impulse that a fluid takes, its tangential part `−radius·normal` away.
struct FluidImpulse {
  Vec3d impulse = Vec3d::Zero();
  Vec3d x = Vec3d::Zero();
  Vec3d normal = Vec3d::Zero();
  double radius = 0.0;
};

template <class S, class Sums>
FluidImpulse fluid_impulse_adjoint(const UpdatedPlace<S>& place, const ContactPoint& point,
                                   const Vec3d& impulse, double dx, const Sums& sums) {
  const Vec3d& n = point.normal;
  FluidImpulse bar;
  const double along = n.dot(impulse);
  const Vec3d tangential = impulse - along * n;
  S offset[3];
  for (int a = 0; a < 3; ++a) offset[a] = static_cast<S>(-point.radius * n[a] / dx);
  const OffsetPlace<S> face(place, offset);
  const GridSums center = sums(place, place.fraction());
  const GridSums at_face =
      sums(place, Vec3d(static_cast<double>(face.f[0]), static_cast<double>(face.f[1]),
                        static_cast<double>(face.f[2])));
  const Vec3d difference = center.momentum - at_face.momentum;
  bar.impulse = at_face.momentum + n.dot(difference) * n;
  bar.normal = along * difference + n.dot(difference) * impulse;
  bar.x = center.momentum_by.transpose() * (along * n);

  // Place of the face, in cells: f + reach · offset.
  const Vec3d face_bar = dx * (at_face.momentum_by.transpose() * tangential);
  const auto reach = static_cast<double>(face.reach);
  Vec3d offset_bar = reach * face_bar;
  Vec3d f_bar = face_bar;
  if (face.axis >= 0 && reach > 0.0) {
    const auto o = static_cast<double>(offset[face.axis]);
    double reach_bar = 0.0;
    for (int a = 0; a < 3; ++a) reach_bar += face_bar[a] * static_cast<double>(offset[a]);
    const double size = std::max(std::abs(o), 1e-6);
    f_bar[face.axis] += (o < 0.0 ? -1.0 : 1.0) * reach_bar / size;
    if (std::abs(o) > 1e-6) offset_bar[face.axis] -= reach_bar * reach / o;
  }
  bar.x += f_bar / dx;
  bar.radius = -n.dot(offset_bar) / dx;
  bar.normal -= point.radius / dx * offset_bar;
  return bar;
}

}  // namespace

template <class S>
UpdatedLoadsAdjoint<S>::UpdatedLoadsAdjoint(const Scene& scene,
                                            const std::vector<UpdatedMember<S>>& members,
                                            std::vector<shape::ColliderPtr> colliders)
    : dx_(scene.dx), members_(members), colliders_(std::move(colliders)) {}

template <class S>
void UpdatedLoadsAdjoint<S>::back(Arena& arena, const UpdatedRecord<S>& record,
                                  const std::vector<S>& nodes, const S* velocity,
                                  std::vector<UpdatedBodyCotangents<S>>& bodies,
                                  shape::ColliderCotangents* colliders,
                                  std::vector<double>& velocity_bar) const {
  const Substep at{&record, &nodes, velocity, dx_};
  for (const UpdatedCarry<S>& c : record.carries) {
    carry(at, c, bodies[c.member].particles[c.particle], velocity_bar);
  }
  for (const UpdatedHold<S>& h : record.holds) hold(at, h, bodies[h.member]);

  // Groups of touches, those of one particle together, side by side; their sums in order.
  constexpr std::size_t kGroup = 64;
  const std::vector<UpdatedTouch<S>>& touches = record.touches;
  std::vector<std::size_t> first;
  bool fluid = false;
  for (std::size_t t = 0; t < touches.size(); ++t) {
    fluid = fluid || members_[touches[t].member].wets();
    const bool same = t > 0 && touches[t].member == touches[t - 1].member &&
                      touches[t].particle == touches[t - 1].particle;
    if (first.empty() || (!same && t >= first.back() + kGroup)) first.push_back(t);
  }
  std::vector<Sums> sums(first.size());
  const auto group = [&](std::size_t g) {
    sums[g].colliders.resize(colliders_.size());
    sums[g].log_density.resize(members_.size());
    std::size_t t = g + 1 < first.size() ? first[g + 1] : touches.size();
    while (t > first[g]) {
      --t;
      touch(at, touches[t], bodies[touches[t].member], sums[g], velocity_bar);
    }
  };
  if (fluid) {  // their nodes are others' too
    for (std::size_t g = first.size(); g > 0; --g) group(g - 1);
  } else {
    arena.parallel_for(0, first.size(), 1, group);
  }
  for (const Sums& of_group : sums) {
    for (std::size_t c = 0; c < colliders_.size(); ++c) colliders[c] += of_group.colliders[c];
    for (std::size_t m = 0; m < members_.size(); ++m) {
      bodies[m].log_density += of_group.log_density[m];
    }
  }
}

// Momentum M (target − x)/dt and mass M, M = weight · ρ V.
template <class S>
void UpdatedLoadsAdjoint<S>::hold(const Substep& at, const UpdatedHold<S>& hold,
                                  UpdatedBodyCotangents<S>& body) const {
  const UpdatedMember<S>& member = members_[hold.member];
  const double dt = at.record->dt;
  const double time = at.record->time + dt;
  const Pin* pin = holding_pin(member, hold.particle, time);
  if (pin == nullptr) return;
  const Vec3d& rest = member.rest[hold.particle];
  const Vec3d target = pin_target(*pin, rest, time + dt);
  const Vec3d velocity = (target - at.position(hold.place)) / dt;
  const double mass = kPinWeight * member.density * static_cast<double>(hold.volume);
  const GridSums sums = at.sums(hold.place, hold.place.fraction());
  const Vec3d target_bar = mass / dt * sums.momentum;
  const Vec3d rest_bar = pin->motion.at(time + dt).rotation.conjugate() * target_bar;
  body.rest[hold.particle] += rest_bar;
  body.pivots += target_bar - rest_bar;
  body.turn += target.cross(target_bar) - rest.cross(rest_bar);
  body.log_density += mass * (velocity.dot(sums.momentum) + sums.mass);
  add_to<S>(mass * (sums.momentum_by.transpose() * velocity + sums.mass_by) - target_bar,
            body.particles[hold.particle].position);
}

// Momentum m (v + G (x_I − x)) and mass m, G = Σ v_I ∇w_I.
template <class S>
void UpdatedLoadsAdjoint<S>::carry(const Substep& at, const UpdatedCarry<S>& carry,
                                   UpdatedParticleBar<S>& bar,
                                   std::vector<double>& velocity_bar) const {
  const Vec3d f = carry.place.fraction();
  const PointStencil s(f, dx_);
  const Mat3d gradient = at.velocity_gradient(carry.place, s);
  Vec3d v_bar = Vec3d::Zero();
  Vec3d x_bar = Vec3d::Zero();
  Mat3d gradient_bar = Mat3d::Zero();
  for_each_cotangent(
      *at.record->after, *at.nodes, carry.place,
      [&](const Vec3d& momentum, double mass, std::size_t i, std::size_t j, std::size_t k) {
        const double share = carry.mass * s.weight(i, j, k);
        const Vec3d arm = dx_ * (stencil_node(i, j, k) - f);
        v_bar += share * momentum;
        gradient_bar += share * momentum * arm.transpose();
        const double all = momentum.dot(carry.velocity + gradient * arm) + mass;
        x_bar += carry.mass * all * s.gradient(i, j, k) - share * (gradient.transpose() * momentum);
      });
  at.velocity_gradient_adjoint(carry.place, s, gradient_bar, velocity_bar, x_bar);
  add_to<S>(v_bar, bar.velocity);
  add_to<S>(x_bar, bar.position);
}

template <class S>
void UpdatedLoadsAdjoint<S>::touch(const Substep& at, const UpdatedTouch<S>& touch,
                                   UpdatedBodyCotangents<S>& body, Sums& sums_of_all,
                                   std::vector<double>& velocity_bar) const {
  const UpdatedMember<S>& member = members_[touch.member];
  const shape::Collider& collider = *colliders_[touch.collider];
  const ContactLaw& law = member.contacts[touch.collider];
  const auto id = static_cast<std::int32_t>(touch.collider);
  const double dt = at.record->dt;
  const double time = at.record->time + dt;
  const auto volume = static_cast<double>(touch.volume);

  // Forward again.
  const Vec3d x = at.position(touch.place);
  const Vec3d v(static_cast<double>(touch.velocity[0]), static_cast<double>(touch.velocity[1]),
                static_cast<double>(touch.velocity[2]));
  const Mat3d f = deformation_gradient_of(touch.h);
  const shape::SurfacePoint surface = collider.closest(x, time);
  ContactPoint point = contact_point(surface, f, volume, member.density, v);
  const Vec3d& n = point.normal;
  const bool fluid = member.wets();
  const bool sheared = fluid && (point.distance < point.radius || touch.memory.surface == id);
  const PointStencil s(touch.place.fraction(), dx_);
  Mat3d gradient = Mat3d::Zero();
  if (sheared) {
    gradient = at.velocity_gradient(touch.place, s);
    point.relative_velocity -= point.radius * (gradient * n);
  }
  ContactMemory memory = touch.memory;
  const Vec3d force = contact_force(law, point, id, dt, memory);

  // The impulse.
  FluidImpulse of_impulse;
  if (!force.isZero(0.0)) {
    const Vec3d impulse = dt * force;
    const auto sums = [&](const UpdatedPlace<S>& place, const Vec3d& where) {
      return at.sums(place, where);
    };
    if (fluid) {
      of_impulse = fluid_impulse_adjoint(touch.place, point, impulse, dx_, sums);
    } else {
      const GridSums center = at.sums(touch.place, touch.place.fraction());
      of_impulse.impulse = center.momentum;
      of_impulse.x = center.momentum_by.transpose() * impulse;
    }
  }
  // The law.
  Vec3d& stretch_bar = body.stretch[touch.particle];
  ContactCotangents c =
      contact_force_adjoint(law, point, id, dt, touch.memory, dt * of_impulse.impulse, stretch_bar);
  stretch_bar = c.stretch;
  shape::ColliderCotangents& own = sums_of_all.colliders[touch.collider];
  own.mu += c.mu;
  own.stiffness += c.stiffness;
  own.damping += c.damping;
  c.radius += of_impulse.radius;
  c.normal += of_impulse.normal;
  Vec3d x_bar = of_impulse.x;
  if (sheared) {
    // v_rel −= r G n, G = Σ v_I ∇w_I.
    c.radius -= c.relative_velocity.dot(gradient * n);
    c.normal -= point.radius * (gradient.transpose() * c.relative_velocity);
    at.velocity_gradient_adjoint(
        touch.place, s, -point.radius * c.relative_velocity * n.transpose(), velocity_bar, x_bar);
  }
  const ContactPointCotangents p = contact_point_adjoint(n, f, volume, c);
  sums_of_all.log_density[touch.member] += member.density * p.density;
  x_bar += back_to_surface(collider, x, time, shape::kColliderProbe * dx_, surface, c.distance,
                           c.normal + p.normal, -c.relative_velocity, own);
  UpdatedParticleBar<S>& bar = body.particles[touch.particle];
  add_to<S>(x_bar, bar.position);
  add_to<S>(c.relative_velocity, bar.velocity);
  for (std::size_t i = 0; i < 9; ++i) {
    bar.h[i] +=
        static_cast<S>(p.deformation_gradient(static_cast<int>(i / 3), static_cast<int>(i % 3)));
  }
}

template class UpdatedLoadsAdjoint<float>;
template class UpdatedLoadsAdjoint<double>;

}  // namespace matterfit::mpm
