// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/contact_law_adjoint.hpp"
#include "mpm/updated_back.hpp"
#include "mpm/updated_contact.hpp"

namespace matterfit::mpm {
namespace {

template <class S>
Mat3d deformation_gradient_of(const S h[9]) {
  Mat3d f = Mat3d::Identity();
  for (int i = 0; i < 9; ++i) f(i / 3, i % 3) += static_cast<double>(h[i]);
  return f;
}

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
  Vec3d offset_bar = Vec3d::Zero();
  Vec3d f_bar = Vec3d::Zero();
  face.back(offset, face_bar, f_bar, offset_bar);
  bar.x += f_bar / dx;
  bar.radius = -n.dot(offset_bar) / dx;
  bar.normal -= point.radius / dx * offset_bar;
  return bar;
}

}  // namespace

template <class S>
void UpdatedContact<S>::act_adjoint(Arena& arena, const UpdatedBack<S>& at, const UpdatedActs& acts,
                                    UpdatedCotangents<S>& bar,
                                    std::vector<double>& velocity_bar) const {
  // Groups of touches, those of one particle together, side by side; their sums in order.
  constexpr std::size_t kGroup = 64;
  const std::vector<UpdatedTouch<S>>& touches = UpdatedActsOf<UpdatedTouch<S>>::of(acts);
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
      back(at, touches[t], bar.bodies[touches[t].member], sums[g], velocity_bar);
    }
  };
  if (fluid) {  // their nodes are others' too
    for (std::size_t g = first.size(); g > 0; --g) group(g - 1);
  } else {
    arena.parallel_for(0, first.size(), 1, group);
  }
  std::vector<shape::ColliderCotangents> colliders(colliders_.size());
  for (const Sums& of_group : sums) {
    for (std::size_t c = 0; c < colliders.size(); ++c) colliders[c] += of_group.colliders[c];
    for (std::size_t m = 0; m < members_.size(); ++m) {
      bar.bodies[m].log_density += of_group.log_density[m];
    }
  }
  for (std::size_t c = 0; c < colliders.size(); ++c) bar.colliders[places_[c]] += colliders[c];
}

template <class S>
void UpdatedContact<S>::back(const UpdatedBack<S>& at, const UpdatedTouch<S>& touch,
                             UpdatedBodyCotangents<S>& body, Sums& sums_of_all,
                             std::vector<double>& velocity_bar) const {
  const UpdatedMember<S>& member = members_[touch.member];
  const shape::Collider& collider = *colliders_[touch.collider];
  const ContactLaw& law = member.contacts[touch.collider];
  const auto id = static_cast<std::int32_t>(touch.collider);
  const double dt = at.dt();
  const double time = at.time();
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
  const PointStencil s(touch.place.fraction(), at.dx());
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
      of_impulse = fluid_impulse_adjoint(touch.place, point, impulse, at.dx(), sums);
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
  x_bar += back_to_surface(collider, x, time, shape::kColliderProbe * at.dx(), surface, c.distance,
                           c.normal + p.normal, -c.relative_velocity, own);
  UpdatedParticleBar<S>& bar = body.particles[touch.particle];
  add_to<S>(x_bar, bar.position);
  add_to<S>(c.relative_velocity, bar.velocity);
  for (std::size_t i = 0; i < 9; ++i) {
    bar.h[i] +=
        static_cast<S>(p.deformation_gradient(static_cast<int>(i / 3), static_cast<int>(i % 3)));
  }
}

template void UpdatedContact<float>::back(const UpdatedBack<float>&, const UpdatedTouch<float>&,
                                          UpdatedBodyCotangents<float>&, Sums&,
                                          std::vector<double>&) const;
template void UpdatedContact<double>::back(const UpdatedBack<double>&, const UpdatedTouch<double>&,
                                           UpdatedBodyCotangents<double>&, Sums&,
                                           std::vector<double>&) const;
template void UpdatedContact<float>::act_adjoint(Arena&, const UpdatedBack<float>&,
                                                 const UpdatedActs&, UpdatedCotangents<float>&,
                                                 std::vector<double>&) const;
template void UpdatedContact<double>::act_adjoint(Arena&, const UpdatedBack<double>&,
                                                  const UpdatedActs&, UpdatedCotangents<double>&,
                                                  std::vector<double>&) const;

}  // namespace matterfit::mpm
