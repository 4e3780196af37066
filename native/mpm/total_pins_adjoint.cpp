// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>
#include <algorithm>

#include "mpm/total_pins.hpp"
#include "mpm/total_stencil.hpp"

namespace matterfit::mpm {

void TotalPins::step_adjoint(double kick, double dt, double time, const Vec3d& gravity,
                             const std::vector<Vec3d>& acceleration,
                             std::vector<double>& displacement_bar,
                             std::vector<double>& velocity_bar,
                             std::vector<Vec3d>& acceleration_bar, Vec3d& gravity_bar,
                             double& log_density_bar) const {
  const auto index = [&](std::uint32_t node) {
    return static_cast<std::size_t>(std::lower_bound(nodes_.begin(), nodes_.end(), node) -
                                    nodes_.begin());
  };
  const std::size_t count = nodes_.size();
  std::vector<Vec3d> u(count);    // of displacements before
  std::vector<Vec3d> old(count);  // of velocities before
  std::vector<Vec3d> v(count);    // of velocities as they are formed
  std::vector<Vec3d> a(count, Vec3d::Zero());
  for (std::size_t i = 0; i < count; ++i) {
    u[i] = field_value(displacement_bar, nodes_[i]);
    v[i] = field_value(velocity_bar, nodes_[i]) + dt * u[i];
    old[i].setZero();
  }
  for (auto clamp = clamps_.rbegin(); clamp != clamps_.rend(); ++clamp) {
    if (time >= clamp->pin.release - 1e-12) continue;
    for (auto mirror = clamp->mirrors.rbegin(); mirror != clamp->mirrors.rend(); ++mirror) {
      const std::size_t f = index(mirror->free);
      const std::size_t g = index(mirror->ghost);
      const double mass_free = grid_.mass()[mirror->free];
      const double mass_ghost = grid_.mass()[mirror->ghost];
      const Vec3d relative = v[f] - v[g];
      const Vec3d impulse = relative / (mass_free + mass_ghost);
      const Vec3d plane_old = (mass_free - mass_ghost) * impulse;
      const Vec3d plane = v[f] + v[g] - plane_old;
      old[f] += 0.5 * (relative + plane_old);
      old[g] += 0.5 * (plane_old - relative);
      a[f] += kick * mass_free * impulse;
      a[g] -= kick * mass_ghost * impulse;
      u[f] -= 0.5 / dt * plane;
      u[g] -= 0.5 / dt * plane;
      v[f].setZero();
      v[g].setZero();
    }
    for (const std::uint32_t node : clamp->prescribed) {
      const std::size_t i = index(node);
      u[i] -= v[i] / dt;
      v[i].setZero();
    }
    const PointConstraints& points = clamp->constraints;
    if (points.rows.empty()) continue;
    Eigen::MatrixXd q(static_cast<Eigen::Index>(points.rows.size()), 3);
    for (std::size_t r = 0; r < points.rows.size(); ++r) {
      const NodeWeights& row = points.rows[r];
      Vec3d sum = Vec3d::Zero();
      for (std::size_t n = 0; n < row.nodes.size(); ++n) {
        sum += row.weights[n] * grid_.inverse_mass()[row.nodes[n]] * v[index(row.nodes[n])];
      }
      q.row(static_cast<Eigen::Index>(r)) = sum.transpose();
    }
    const auto lower = points.factor.triangularView<Eigen::Lower>();
    lower.solveInPlace(q);
    lower.transpose().solveInPlace(q);
    for (std::size_t r = 0; r < points.rows.size(); ++r) {
      const NodeWeights& row = points.rows[r];
      const Vec3d back = q.row(static_cast<Eigen::Index>(r)).transpose();
      for (std::size_t n = 0; n < row.nodes.size(); ++n) {
        const std::size_t i = index(row.nodes[n]);
        v[i] -= row.weights[n] * back;
        u[i] -= row.weights[n] / dt * back;
      }
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    old[i] += v[i];
    a[i] += kick * v[i];
  }

  const MassGroup* group = nullptr;
  for (const MassGroup& g : mass_groups_) {
    if (time + 1e-12 >= g.from) group = &g;
  }
  if (group != nullptr) {
    const auto rows = static_cast<Eigen::Index>(group->count);
    Eigen::MatrixX3d relative(rows, 3);
    Eigen::MatrixX3d solved_bar(rows, 3);
    Eigen::MatrixX3d force_bar(rows, 3);
    for (std::size_t k = 0; k < group->count; ++k) {
      const NodeWeights& w = masses_[k].weights;
      Vec3d free = -gravity;
      Vec3d sum = Vec3d::Zero();
      for (std::size_t n = 0; n < w.nodes.size(); ++n) {
        const std::size_t i = index(w.nodes[n]);
        free += w.weights[n] * acceleration[i];
        sum += w.weights[n] * grid_.inverse_mass()[w.nodes[n]] * a[i];
      }
      const auto row = static_cast<Eigen::Index>(k);
      relative.row(row) = free.transpose();
      force_bar.row(row) = sum.transpose();
      solved_bar.row(row) = -masses_[k].mass * sum.transpose();
    }
    Eigen::MatrixX3d weighted = group->inverse * relative;  // m solved
    for (std::size_t k = 0; k < group->count; ++k) {
      weighted.row(static_cast<Eigen::Index>(k)) *= masses_[k].mass;
    }
    const Eigen::MatrixX3d relative_bar = group->inverse.transpose() * solved_bar;
    // M⁻¹ and the compliance W M⁻¹ Wᵀ go with the inverse of the density.
    log_density_bar += (force_bar.array() * weighted.array()).sum() +
                       (relative_bar.array() * (group->compliance * weighted).array()).sum();
    for (std::size_t k = 0; k < group->count; ++k) {
      const NodeWeights& w = masses_[k].weights;
      const Vec3d back = relative_bar.row(static_cast<Eigen::Index>(k)).transpose();
      gravity_bar -= back;
      for (std::size_t n = 0; n < w.nodes.size(); ++n) a[index(w.nodes[n])] += w.weights[n] * back;
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    set_field_value(displacement_bar, nodes_[i], u[i]);
    set_field_value(velocity_bar, nodes_[i], old[i]);
  }
  acceleration_bar = std::move(a);
}

}  // namespace matterfit::mpm
