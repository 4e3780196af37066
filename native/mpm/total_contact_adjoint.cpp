// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_contact_adjoint.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "mpm/total_stencil.hpp"

namespace matterfit::mpm {
template <class S>
TotalContactAdjoint<S>::TotalContactAdjoint(const Body& body, const Scene& scene,
                                            TotalBody<S>& total)
    : body_(total),
      density_(body.density),
      probe_(shape::kColliderProbe * scene.dx),
      colliders_(scene.colliders) {
  for (const shape::ColliderPtr& collider : colliders_) {
    laws_.push_back(resolve_contact(collider->contact(), body, scene.dx));
  }
  bars_.resize(colliders_.size());
  stretch_bar_.assign(total.particles(), Vec3d::Zero());
  group_of_.assign(total.blocks(), kNoBlock);
}

template <class S>
void TotalContactAdjoint<S>::set_memory(const ContactMemories& before,
                                        const ContactMemories& after) {
  for (std::size_t g = 0; g < group_count_; ++g) group_of_[groups_[g].block] = kNoBlock;
  group_count_ = 0;
  const auto add = [&](std::uint32_t particle, const ContactMemory& memory) {
    const std::uint32_t block = body_.grid().block(particle);
    if (group_of_[block] == kNoBlock) {
      group_of_[block] = static_cast<std::uint32_t>(group_count_++);
      if (group_count_ > groups_.size()) groups_.emplace_back();
      Group& group = groups_[group_count_ - 1];
      group.block = block;
      group.particles.clear();
    }
    groups_[group_of_[block]].particles.push_back({particle, memory, body_.place(particle)});
  };
  auto next = after.begin();
  const auto add_until = [&](std::uint32_t particle) {
    for (; next != after.end() && next->first < particle; ++next) add(next->first, {});
  };
  for (const auto& [particle, remembered] : before) {
    add_until(particle);
    if (next != after.end() && next->first == particle) ++next;
    add(particle, remembered);
  }
  add_until(std::numeric_limits<std::uint32_t>::max());
}

template <class S>
void TotalContactAdjoint<S>::meet(Group& group, const TotalSubstep& substep) const {
  group.touches.clear();
  const TotalBlock<S> block(body_, group.block);
  for (std::size_t i = 0; i < group.particles.size(); ++i) {
    Particle& particle = group.particles[i];
    ContactMemory memory = particle.memory;
    const std::uint32_t p = particle.particle;
    particle.position = block.state(particle.center).position;
    particle.f = block.deformation_gradient(particle.center);
    const double half = 0.5 * std::cbrt(body_.volume(p));
    for (std::size_t s = 0; s < colliders_.size(); ++s) {
      const shape::SurfacePoint surface = colliders_[s]->closest(particle.position, substep.time);
      const auto id = static_cast<std::int32_t>(s);
      if (surface.distance > 4.0 * half && memory.surface != id) continue;
      const Vec3d direction = -(particle.f.transpose() * surface.normal).normalized();
      Touch touch{i, s, memory, surface.normal, body_.face(p, direction)};
      const auto state = block.state(touch.face);
      touch.face_position = state.position;
      touch.below = colliders_[s]->closest(touch.face_position, substep.time);
      touch.point =
          contact_point(touch.below, particle.f, body_.volume(p), density_, state.velocity);
      touch.point.radius = 0.0;
      touch.force = contact_force(laws_[s], touch.point, id, substep.dt, memory);
      group.touches.push_back(touch);
    }
  }
}

template <class S>
void TotalContactAdjoint<S>::prepare(Arena& arena, const TotalSubstep& substep, bool forces) {
  arena.parallel_for(0, group_count_, 1, [&](std::size_t g) {
    Group& group = groups_[g];
    meet(group, substep);
    if (!forces) return;
    for (const Touch& touch : group.touches) {
      if (touch.force.isZero(0.0)) continue;
      body_.add_load(group.particles[touch.particle].particle, touch.face, touch.force);
    }
  });
}

template <class S>
void TotalContactAdjoint<S>::back(Arena& arena, const TotalSubstep& substep,
                                  const std::vector<double>& force_bar, TotalCotangents<S>& bar) {
  arena.parallel_for(0, group_count_, 1,
                     [&](std::size_t g) { back(groups_[g], substep, force_bar); });
  add_to(arena, bar);
  for (std::size_t g = 0; g < group_count_; ++g) {
    const Group& group = groups_[g];
    for (std::size_t t = 0; t < group.bars.size(); ++t) {
      if (group.bars[t].any) bars_[group.touches[t].collider] += group.bars[t].collider;
      bar.log_density += group.bars[t].log_density;
    }
  }
}

template <class S>
void TotalContactAdjoint<S>::back(Group& group, const TotalSubstep& substep,
                                  const std::vector<double>& force_bar) {
  const TotalBlock<S> block(body_, group.block);
  BlockField block_force_bar;
  block_force_bar.gather(body_.grid(), group.block, force_bar.data());
  group.displacement_bar.clear();
  group.velocity_bar.clear();
  group.bars.resize(group.touches.size());
  for (std::size_t t = group.touches.size(); t-- > 0;) {
    const Touch& touch = group.touches[t];
    const Particle& particle = group.particles[touch.particle];
    TouchBar& own = group.bars[t];
    own = back(particle, touch, substep, block, block_force_bar, force_bar,
               stretch_bar_[particle.particle]);
    if (!own.any) continue;
    const double dx = body_.grid().dx();
    group.displacement_bar.add({particle.center.cell, dx}, own.center, own.f);
    if (!block.holds(touch.face)) continue;
    const BlockField::Stencil face(touch.face.cell, dx);
    group.displacement_bar.add(face, own.face);
    group.velocity_bar.add(face, own.face_velocity);
  }
}

template <class S>
void TotalContactAdjoint<S>::add_to(Arena& arena, TotalCotangents<S>& bar) const {
  const TotalGrid& grid = body_.grid();
  double* u_bar = bar.state.displacement.data();
  double* v_bar = bar.state.velocity.data();
  // Sums must not depend on threads: each is made in order, by one.
  arena.parallel_for(0, grid.node_blocks(), 4, [&](std::size_t b) {
    const std::array<std::uint32_t, 8>& sources = grid.node_sources(b);
    for (std::size_t k = 0; k < 8; ++k) {
      if (sources[k] == kNoBlock || group_of_[sources[k]] == kNoBlock) continue;
      const Group& group = groups_[group_of_[sources[k]]];
      group.displacement_bar.add_to(k, u_bar + b * kNodeBlock);
      group.velocity_bar.add_to(k, v_bar + b * kNodeBlock);
    }
  });
  for (std::size_t g = 0; g < group_count_; ++g) {
    const Group& group = groups_[g];
    for (std::size_t t = 0; t < group.bars.size(); ++t) {
      const Place& face = group.touches[t].face;
      const TouchBar& own = group.bars[t];
      if (!own.any || face.cell.block == group.block) continue;
      const FieldStencil s(grid, face.cell);
      for (std::size_t c = 0; c < 3; ++c) {
        add_to_field(s, c, own.face[static_cast<int>(c)], u_bar);
        add_to_field(s, c, own.face_velocity[static_cast<int>(c)], v_bar);
      }
    }
  }
}

template <class S>
typename TotalContactAdjoint<S>::TouchBar TotalContactAdjoint<S>::back(
    const Particle& particle, const Touch& touch, const TotalSubstep& substep,
    const TotalBlock<S>& block, const BlockField& block_force_bar,
    const std::vector<double>& force_bar, Vec3d& stretch_bar) const {
  TouchBar out;
  const TotalGrid& grid = body_.grid();
  const Mat3d to_local = grid.axes().transpose();
  const Vec3d force = to_local * touch.force;
  // Values and gradients at the face, of node fields in body axes.
  const BlockField::Stencil here(touch.face.cell, grid.dx());
  std::optional<FieldStencil> elsewhere;
  if (!block.holds(touch.face)) elsewhere.emplace(grid, touch.face.cell);
  const auto gradient = [&](const BlockField& of_block, const std::vector<double>& field) -> Mat3d {
    return elsewhere ? field_gradient(*elsewhere, field.data()) : of_block.gradient(here);
  };

  // The load: f_I += w_I F.
  const Vec3d load_bar =
      elsewhere ? field_at(*elsewhere, force_bar.data()) : block_force_bar.at(here);
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
  // The cotangent of the face's place at rest, body axes.
  const Vec3d place_bar =
      out.face + gradient(block_force_bar, force_bar).transpose() * force +
      gradient(block.displacement(), body_.displacement()).transpose() * out.face +
      gradient(block.velocity(), body_.velocity()).transpose() * out.face_velocity;
  // face = r(d) d, d = −Fᵀn/|Fᵀn|, r the reach.
  const Vec3d pulled = particle.f.transpose() * touch.center_normal;
  const Vec3d direction = pulled.normalized();
  const TotalGrid::Reach reach = grid.reach(particle.particle, -direction);
  const Vec3d world_bar = grid.axes() * place_bar;
  const Vec3d direction_bar = -reach.distance * world_bar + direction.dot(world_bar) * reach.slope;
  const Vec3d pulled_bar =
      (direction_bar - direction.dot(direction_bar) * direction) / pulled.norm();
  shape::SurfacePoint at_center;
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
                                              const shape::SurfacePoint& at, double distance_bar,
                                              const Vec3d& normal_bar, const Vec3d& velocity_bar,
                                              double time, shape::ColliderCotangents& own) const {
  return shape::back_to_surface(*colliders_[collider], x, time, probe_, at, distance_bar,
                                normal_bar, velocity_bar, own);
}

template class TotalContactAdjoint<float>;
template class TotalContactAdjoint<double>;

}  // namespace matterfit::mpm
