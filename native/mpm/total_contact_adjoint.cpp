// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_contact_adjoint.hpp"

#include <cmath>

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
  memory_.resize(total.particles());
  stretch_bar_.assign(total.particles(), Vec3d::Zero());
}

template <class S>
void TotalContactAdjoint<S>::set_memory(
    std::vector<std::pair<std::uint32_t, ContactMemory>> memory) {
  std::fill(memory_.begin(), memory_.end(), ContactMemory{});
  for (const auto& [particle, remembered] : memory) memory_[particle] = remembered;
}

template <class S>
void TotalContactAdjoint<S>::prepare(const TotalSubstep& substep) {
  touches_.clear();
  for (std::size_t b = 0; b < body_.blocks(); ++b) {
    body_.clear_loads(b);
    for (const std::uint32_t p : body_.block_particles(b)) {
      if (!body_.is_surface(p)) continue;
      ContactMemory memory = memory_[p];
      const auto state = body_.point_state(p);
      const double half = 0.5 * std::cbrt(body_.volume(p));
      for (std::size_t s = 0; s < colliders_.size(); ++s) {
        const SurfacePoint surface = colliders_[s]->closest(state.position, substep.time);
        const auto id = static_cast<std::int32_t>(s);
        if (surface.distance > 4.0 * half && memory.surface != id) continue;
        Touch touch;
        touch.particle = p;
        touch.collider = s;
        touch.memory = memory;
        touch.center_normal = surface.normal;
        touch.f = body_.deformation_gradient(p);
        touch.face = -half * (touch.f.transpose() * surface.normal).normalized();
        const auto face_state = body_.point_state(p, touch.face);
        touch.below = colliders_[s]->closest(face_state.position, substep.time);
        touch.point =
            contact_point(touch.below, touch.f, body_.volume(p), density_, face_state.velocity);
        touch.point.radius = 0.0;
        touch.force = contact_force(laws_[s], touch.point, id, substep.dt, memory);
        if (!touch.force.isZero(0.0)) body_.add_load(p, touch.face, touch.force);
        touches_.push_back(touch);
      }
    }
  }
}

template <class S>
void TotalContactAdjoint<S>::back(const TotalSubstep& substep, const std::vector<double>& force_bar,
                                  TotalCotangents<S>& bar) {
  for (auto touch = touches_.rbegin(); touch != touches_.rend(); ++touch) {
    back(*touch, substep, force_bar, bar);
  }
}

template <class S>
void TotalContactAdjoint<S>::back(const Touch& touch, const TotalSubstep& substep,
                                  const std::vector<double>& force_bar, TotalCotangents<S>& bar) {
  const TotalGrid& grid = body_.grid();
  const Mat3d to_local = grid.axes().transpose();
  const Vec3d rest = grid.rest(touch.particle);
  const Vec3d rest_face = rest + to_local * touch.face;
  const CellPoint at_face = grid.point_in(touch.particle, rest_face);
  const PointStencil s(at_face.f, grid.dx());
  const Vec3d force = to_local * touch.force;
  const std::vector<double>& u = body_.displacement();
  const std::vector<double>& v = body_.velocity();

  // The load: f_I += w_I F.
  Vec3d load_bar = Vec3d::Zero();
  visit_nodes(grid, at_face, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
    load_bar += s.weight(i, j, k) * node_value(force_bar, node);
  });
  bar.log_density -= load_bar.dot(force);
  const auto id = static_cast<std::int32_t>(touch.collider);
  Vec3d& stretch_bar = stretch_bar_[touch.particle];
  const ContactCotangents c =
      contact_force_adjoint(laws_[touch.collider], touch.point, id, substep.dt, touch.memory,
                            grid.axes() * load_bar, stretch_bar);
  stretch_bar = c.stretch;
  if (touch.force.isZero(0.0) && c.distance == 0.0) return;
  ColliderCotangents& own = bars_[touch.collider];
  own.mu += c.mu;
  own.stiffness += c.stiffness;
  own.damping += c.damping;
  ContactCotangents without_radius = c;
  without_radius.radius = 0.0;  // the face itself is met
  const double volume = body_.volume(touch.particle);
  const ContactPointCotangents p =
      contact_point_adjoint(touch.point.normal, touch.f, volume, without_radius);
  bar.log_density += density_ * p.density;
  Mat3d f_bar = p.deformation_gradient;

  const auto face_state = body_.point_state(touch.particle, touch.face);
  const Vec3d x_bar =
      to_local * back_to_surface(touch.collider, face_state.position, touch.below, c.distance,
                                 c.normal + p.normal, -c.relative_velocity, substep.time);
  const Vec3d v_bar = to_local * c.relative_velocity;
  Vec3d place_bar = x_bar;  // of the face's place at rest, body axes
  visit_nodes(grid, at_face, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
    const double w = s.weight(i, j, k);
    add_to_node(bar.state.displacement, node, w * x_bar);
    add_to_node(bar.state.velocity, node, w * v_bar);
    place_bar +=
        s.gradient(i, j, k) * (node_value(force_bar, node).dot(force) +
                               node_value(u, node).dot(x_bar) + node_value(v, node).dot(v_bar));
  });
  // face = −½h Fᵀn/|Fᵀn|.
  const Vec3d pulled = touch.f.transpose() * touch.center_normal;
  const Vec3d direction = pulled.normalized();
  const Vec3d direction_bar = -0.5 * std::cbrt(volume) * (grid.axes() * place_bar);
  const Vec3d pulled_bar =
      (direction_bar - direction.dot(direction_bar) * direction) / pulled.norm();
  f_bar += touch.center_normal * pulled_bar.transpose();
  const Vec3d center = body_.point_state(touch.particle).position;
  SurfacePoint at_center;
  at_center.normal = touch.center_normal;
  const Vec3d center_bar =
      to_local * back_to_surface(touch.collider, center, at_center, 0.0, touch.f * pulled_bar,
                                 Vec3d::Zero(), substep.time);
  const Mat3d f_bar_local = to_local * f_bar * grid.axes();
  const CellPoint at_center_point = grid.point_in(touch.particle, rest);
  const PointStencil r(at_center_point.f, grid.dx());
  visit_nodes(grid, at_center_point,
              [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
                add_to_node(bar.state.displacement, node,
                            r.weight(i, j, k) * center_bar + f_bar_local * r.gradient(i, j, k));
              });
}

template <class S>
Vec3d TotalContactAdjoint<S>::back_to_surface(std::size_t collider, const Vec3d& x,
                                              const SurfacePoint& at, double distance_bar,
                                              const Vec3d& normal_bar, const Vec3d& velocity_bar,
                                              double time) {
  return mpm::back_to_surface(*colliders_[collider], x, time, probe_, at, distance_bar, normal_bar,
                              velocity_bar, bars_[collider]);
}

template class TotalContactAdjoint<float>;
template class TotalContactAdjoint<double>;

}  // namespace matterfit::mpm
