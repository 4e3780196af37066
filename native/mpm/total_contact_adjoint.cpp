// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_contact_adjoint.hpp"

#include <cmath>
#include <limits>

#include "mpm/total_stencil.hpp"

namespace matterfit::mpm {
namespace {

Vec3d node_value(const std::vector<double>& field, std::size_t node) {
  return {field[node], field[node + kBlockNodes], field[node + 2 * kBlockNodes]};
}

void add_to_node(std::vector<double>& field, std::size_t node, const Vec3d& value) {
  for (std::size_t c = 0; c < 3; ++c) {
    field[node + c * kBlockNodes] += value[static_cast<int>(c)];
  }
}

}  // namespace

ColliderCotangents& ColliderCotangents::operator+=(const ColliderCotangents& other) {
  mu += other.mu;
  stiffness += other.stiffness;
  damping += other.damping;
  translation += other.translation;
  rotation += other.rotation;
  return *this;
}

template <class S>
TotalContactAdjoint<S>::TotalContactAdjoint(const Body& body, const Scene& scene,
                                            TotalBody<S>& total)
    : body_(total), density_(body.density), probe_(1e-4 * scene.dx), colliders_(scene.colliders) {
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
      particles_.push_back({next->first, {}, {}, {}});
    }
  };
  for (const auto& [particle, remembered] : before) {
    add_until(particle);
    if (next != after.end() && next->first == particle) ++next;
    particles_.push_back({particle, remembered, {}, {}});
  }
  add_until(std::numeric_limits<std::uint32_t>::max());
}

template <class S>
void TotalContactAdjoint<S>::meet(Particle& particle, const TotalSubstep& substep) const {
  ContactMemory memory = particle.memory;
  const std::uint32_t p = particle.particle;
  const TotalGrid& grid = body_.grid();
  const auto state = body_.point_state(p);
  const double half = 0.5 * std::cbrt(body_.volume(p));
  for (std::size_t s = 0; s < colliders_.size(); ++s) {
    const SurfacePoint surface = colliders_[s]->closest(state.position, substep.time);
    const auto id = static_cast<std::int32_t>(s);
    if (surface.distance > 4.0 * half && memory.surface != id) continue;
    Touch touch;
    touch.collider = s;
    touch.memory = memory;
    touch.center_normal = surface.normal;
    touch.f = body_.deformation_gradient(p);
    touch.face = -half * (touch.f.transpose() * surface.normal).normalized();
    touch.at_face = grid.point_in(p, grid.rest(p) + grid.axes().transpose() * touch.face);
    const auto face_state = body_.point_state(p, touch.face);
    touch.below = colliders_[s]->closest(face_state.position, substep.time);
    touch.point =
        contact_point(touch.below, touch.f, body_.volume(p), density_, face_state.velocity);
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
void TotalContactAdjoint<S>::back(Arena& arena, const TotalSubstep& substep,
                                  const std::vector<double>& force_bar, TotalCotangents<S>& bar) {
  arena.parallel_for(0, particles_.size(), 16, [&](std::size_t i) {
    Particle& particle = particles_[i];
    Vec3d& stretch_bar = stretch_bar_[particle.particle];
    for (auto touch = particle.touches.rbegin(); touch != particle.touches.rend(); ++touch) {
      particle.bars.push_back(back(particle.particle, *touch, substep, force_bar, stretch_bar));
    }
  });
  // In order, on one thread: sums must not depend on threads.
  for (const Particle& particle : particles_) {
    for (std::size_t t = 0; t < particle.bars.size(); ++t) {
      const Touch& touch = particle.touches[particle.bars.size() - 1 - t];
      if (particle.bars[t].any) add(particle.particle, touch, particle.bars[t], bar);
      bar.log_density += particle.bars[t].log_density;
    }
  }
}

template <class S>
typename TotalContactAdjoint<S>::TouchBar TotalContactAdjoint<S>::back(
    std::uint32_t particle, const Touch& touch, const TotalSubstep& substep,
    const std::vector<double>& force_bar, Vec3d& stretch_bar) const {
  TouchBar out;
  const TotalGrid& grid = body_.grid();
  const Mat3d to_local = grid.axes().transpose();
  const PointStencil s(touch.at_face.f, grid.dx());
  const Vec3d force = to_local * touch.force;
  const std::vector<double>& u = body_.displacement();
  const std::vector<double>& v = body_.velocity();

  // The load: f_I += w_I F.
  Vec3d load_bar = Vec3d::Zero();
  visit_nodes(grid, touch.at_face,
              [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
                load_bar += s.weight(i, j, k) * node_value(force_bar, node);
              });
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
  const double volume = body_.volume(particle);
  const ContactPointCotangents p =
      contact_point_adjoint(touch.point.normal, touch.f, volume, without_radius);
  out.log_density += density_ * p.density;

  const auto face_state = body_.point_state(particle, touch.face);
  out.face = to_local * back_to_surface(touch.collider, face_state.position, touch.below,
                                        c.distance, c.normal + p.normal, -c.relative_velocity,
                                        substep.time, out.collider);
  out.face_velocity = to_local * c.relative_velocity;
  Vec3d place_bar = out.face;  // of the face's place at rest, body axes
  visit_nodes(
      grid, touch.at_face, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
        place_bar += s.gradient(i, j, k) *
                     (node_value(force_bar, node).dot(force) + node_value(u, node).dot(out.face) +
                      node_value(v, node).dot(out.face_velocity));
      });
  // face = −½h Fᵀn/|Fᵀn|.
  const Vec3d pulled = touch.f.transpose() * touch.center_normal;
  const Vec3d direction = pulled.normalized();
  const Vec3d direction_bar = -0.5 * std::cbrt(volume) * (grid.axes() * place_bar);
  const Vec3d pulled_bar =
      (direction_bar - direction.dot(direction_bar) * direction) / pulled.norm();
  SurfacePoint at_center;
  at_center.normal = touch.center_normal;
  out.center = to_local * back_to_surface(touch.collider, body_.point_state(particle).position,
                                          at_center, 0.0, touch.f * pulled_bar, Vec3d::Zero(),
                                          substep.time, out.collider);
  out.f = to_local * (p.deformation_gradient + touch.center_normal * pulled_bar.transpose()) *
          grid.axes();
  return out;
}

template <class S>
void TotalContactAdjoint<S>::add(std::uint32_t particle, const Touch& touch, const TouchBar& own,
                                 TotalCotangents<S>& bar) {
  const TotalGrid& grid = body_.grid();
  bars_[touch.collider] += own.collider;
  const PointStencil s(touch.at_face.f, grid.dx());
  visit_nodes(grid, touch.at_face,
              [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
                const double w = s.weight(i, j, k);
                add_to_node(bar.state.displacement, node, w * own.face);
                add_to_node(bar.state.velocity, node, w * own.face_velocity);
              });
  const CellPoint at_center = grid.point_in(particle, grid.rest(particle));
  const PointStencil r(at_center.f, grid.dx());
  visit_nodes(grid, at_center, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
    add_to_node(bar.state.displacement, node,
                r.weight(i, j, k) * own.center + own.f * r.gradient(i, j, k));
  });
}

template <class S>
typename TotalContactAdjoint<S>::Slopes TotalContactAdjoint<S>::slopes(std::size_t collider,
                                                                       const Vec3d& x,
                                                                       double time) const {
  Slopes out;
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d step = Vec3d::Zero();
    step[axis] = probe_;
    const SurfacePoint high = colliders_[collider]->closest(x + step, time);
    const SurfacePoint low = colliders_[collider]->closest(x - step, time);
    out.normal.col(axis) = (high.normal - low.normal) / (2.0 * probe_);
    out.velocity.col(axis) = (high.velocity - low.velocity) / (2.0 * probe_);
  }
  return out;
}

template <class S>
Vec3d TotalContactAdjoint<S>::back_to_surface(std::size_t collider, const Vec3d& x,
                                              const SurfacePoint& at, double distance_bar,
                                              const Vec3d& normal_bar, const Vec3d& velocity_bar,
                                              double time, ColliderCotangents& own) const {
  const Slopes slope = slopes(collider, x, time);
  const Vec3d x_bar = distance_bar * at.normal + slope.normal.transpose() * normal_bar +
                      slope.velocity.transpose() * velocity_bar;
  // A collider that moves by t meets x as it met x − t before; one that turns, x turned back.
  own.translation -= x_bar;
  own.rotation += at.normal.cross(normal_bar) + at.velocity.cross(velocity_bar) - x.cross(x_bar);
  return x_bar;
}

template class TotalContactAdjoint<float>;
template class TotalContactAdjoint<double>;

}  // namespace matterfit::mpm
