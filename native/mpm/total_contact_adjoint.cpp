// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_contact_adjoint.hpp"

#include <cmath>
#include <limits>

namespace matterfit::mpm {
template <class S>
TotalContactAdjoint<S>::TotalContactAdjoint(const Body& body, const Scene& scene,
                                            TotalBody<S>& total)
    : body_(total),
      density_(body.density),
      probe_(kColliderProbe * scene.dx),
      colliders_(scene.colliders) {
  for (const ColliderPtr& collider : colliders_) {
    laws_.push_back(resolve_contact(collider->contact(), body, scene.dx));
  }
  bars_.resize(colliders_.size());
  stretch_bar_.assign(total.particles(), Vec3d::Zero());
}

template <class S>
void TotalContactAdjoint<S>::set_memory(const ContactMemories& before,
                                        const ContactMemories& after) {
  particles_.clear();
  auto next = after.begin();
  const auto add_until = [&](std::uint32_t particle) {
    for (; next != after.end() && next->first < particle; ++next) {
      particles_.push_back({next->first, {}});
    }
  };
  for (const auto& [particle, remembered] : before) {
    add_until(particle);
    if (next != after.end() && next->first == particle) ++next;
    particles_.push_back({particle, remembered});
  }
  add_until(std::numeric_limits<std::uint32_t>::max());
}

template <class S>
void TotalContactAdjoint<S>::meet(Particle& particle, const TotalSubstep& substep) const {
  ContactMemory memory = particle.memory;
  const std::uint32_t p = particle.particle;
  particle.center.emplace(body_.point(p));
  particle.position = body_.state(*particle.center).position;
  particle.f = body_.deformation_gradient(*particle.center);
  const double half = 0.5 * std::cbrt(body_.volume(p));
  for (std::size_t s = 0; s < colliders_.size(); ++s) {
    const SurfacePoint surface = colliders_[s]->closest(particle.position, substep.time);
    const auto id = static_cast<std::int32_t>(s);
    if (surface.distance > 4.0 * half && memory.surface != id) continue;
    const Vec3d offset = -half * (particle.f.transpose() * surface.normal).normalized();
    Touch touch{s, memory, surface.normal, body_.point(p, offset)};
    const auto state = body_.state(touch.face);
    touch.face_position = state.position;
    touch.below = colliders_[s]->closest(touch.face_position, substep.time);
    touch.point = contact_point(touch.below, particle.f, body_.volume(p), density_, state.velocity);
    touch.point.radius = 0.0;
    touch.force = contact_force(laws_[s], touch.point, id, substep.dt, memory);
    particle.touches.push_back(touch);
  }
}

template <class S>
void TotalContactAdjoint<S>::prepare(Arena& arena, const TotalSubstep& substep) {
  arena.parallel_for(0, particles_.size(), 16,
                     [&](std::size_t i) { meet(particles_[i], substep); });
  for (std::size_t b = 0; b < body_.blocks(); ++b) body_.clear_loads(b);
  for (const Particle& particle : particles_) {
    for (const Touch& touch : particle.touches) {
      if (!touch.force.isZero(0.0)) body_.add_load(particle.particle, touch.face, touch.force);
    }
  }
}

template <class S>
template <class Use>
void TotalContactAdjoint<S>::for_each_bar(const Use& use) const {
  for (const Particle& particle : particles_) {
    const std::size_t count = particle.bars.size();
    for (std::size_t t = 0; t < count; ++t) {
      use(particle, particle.touches[count - 1 - t], particle.bars[t]);
    }
  }
}

template <class S>
void TotalContactAdjoint<S>::back(Arena& arena, const TotalSubstep& substep,
                                  const std::vector<double>& force_bar, TotalCotangents<S>& bar) {
  arena.parallel_for(0, particles_.size(), 16, [&](std::size_t i) {
    Particle& particle = particles_[i];
    Vec3d& stretch_bar = stretch_bar_[particle.particle];
    for (auto touch = particle.touches.rbegin(); touch != particle.touches.rend(); ++touch) {
      particle.bars.push_back(back(particle, *touch, substep, force_bar, stretch_bar));
    }
  });
  // Sums must not depend on threads: each is made in order, by one.
  arena.parallel_for(0, 6, 1, [&](std::size_t task) {
    const std::size_t c = task % 3;
    const auto axis = static_cast<int>(c);
    double* u_bar = bar.state.displacement.data();
    double* v_bar = bar.state.velocity.data();
    for_each_bar([&](const Particle& particle, const Touch& touch, const TouchBar& own) {
      if (!own.any) return;
      if (task < 3) {
        add_to_field(touch.face.field, c, own.face[axis], u_bar);
        add_to_field(particle.center->field, c, own.center[axis], own.f.row(axis), u_bar);
      } else {
        add_to_field(touch.face.field, c, own.face_velocity[axis], v_bar);
      }
    });
  });
  for_each_bar([&](const Particle&, const Touch& touch, const TouchBar& own) {
    if (own.any) bars_[touch.collider] += own.collider;
    bar.log_density += own.log_density;
  });
}

template <class S>
typename TotalContactAdjoint<S>::TouchBar TotalContactAdjoint<S>::back(
    const Particle& particle, const Touch& touch, const TotalSubstep& substep,
    const std::vector<double>& force_bar, Vec3d& stretch_bar) const {
  TouchBar out;
  const TotalGrid& grid = body_.grid();
  const Mat3d to_local = grid.axes().transpose();
  const FieldStencil& s = touch.face.field;
  const Vec3d force = to_local * touch.force;

  // The load: f_I += w_I F.
  const Vec3d load_bar = field_at(s, force_bar.data());
  out.log_density = -load_bar.dot(force);
  const auto id = static_cast<std::int32_t>(touch.collider);
  const ContactCotangents c =
      contact_force_adjoint(laws_[touch.collider], touch.point, id, substep.dt, touch.memory,
                            grid.axes() * load_bar, stretch_bar);
  stretch_bar = c.stretch;
  if (touch.force.isZero(0.0) && c.distance == 0.0) return out;
  out.any = true;
  out.collider.mu = c.mu;
  out.collider.stiffness = c.stiffness;
  out.collider.damping = c.damping;
  ContactCotangents without_radius = c;
  without_radius.radius = 0.0;  // the face itself is met
  const double volume = body_.volume(particle.particle);
  const ContactPointCotangents p =
      contact_point_adjoint(touch.point.normal, particle.f, volume, without_radius);
  out.log_density += density_ * p.density;

  out.face = to_local * back_to_surface(touch.collider, touch.face_position, touch.below,
                                        c.distance, c.normal + p.normal, -c.relative_velocity,
                                        substep.time, out.collider);
  out.face_velocity = to_local * c.relative_velocity;
  const double* u = body_.displacement().data();
  const double* v = body_.velocity().data();
  // Of the face's place at rest, body axes.
  const Vec3d place_bar = out.face + gradient_of(s, [&](std::size_t n) {
                            double of_node = 0.0;
                            for (int axis = 0; axis < 3; ++axis) {
                              const std::size_t at =
                                  s.node[n] + static_cast<std::size_t>(axis) * kBlockNodes;
                              of_node += force_bar[at] * force[axis] + u[at] * out.face[axis] +
                                         v[at] * out.face_velocity[axis];
                            }
                            return of_node;
                          });
  // face = −½h Fᵀn/|Fᵀn|.
  const Vec3d pulled = particle.f.transpose() * touch.center_normal;
  const Vec3d direction = pulled.normalized();
  const Vec3d direction_bar = -0.5 * std::cbrt(volume) * (grid.axes() * place_bar);
  const Vec3d pulled_bar =
      (direction_bar - direction.dot(direction_bar) * direction) / pulled.norm();
  SurfacePoint at_center;
  at_center.normal = touch.center_normal;
  out.center = to_local * back_to_surface(touch.collider, particle.position, at_center, 0.0,
                                          particle.f * pulled_bar, Vec3d::Zero(), substep.time,
                                          out.collider);
  out.f = to_local * (p.deformation_gradient + touch.center_normal * pulled_bar.transpose()) *
          grid.axes();
  return out;
}

template <class S>
Vec3d TotalContactAdjoint<S>::back_to_surface(std::size_t collider, const Vec3d& x,
                                              const SurfacePoint& at, double distance_bar,
                                              const Vec3d& normal_bar, const Vec3d& velocity_bar,
                                              double time, ColliderCotangents& own) const {
  return mpm::back_to_surface(*colliders_[collider], x, time, probe_, at, distance_bar, normal_bar,
                              velocity_bar, own);
}

template class TotalContactAdjoint<float>;
template class TotalContactAdjoint<double>;

}  // namespace matterfit::mpm
