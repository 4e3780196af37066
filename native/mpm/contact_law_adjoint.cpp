// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/contact_law_adjoint.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace matterfit::mpm {

ContactCotangents contact_force_adjoint(const ContactLaw& law, const ContactPoint& point,
                                        std::int32_t surface, double dt,
                                        const ContactMemory& memory, const Vec3d& force_bar,
                                        const Vec3d& stretch_bar) {
  ContactCotangents bar;
  const double depth = point.radius - point.distance;
  const bool separates = shape::may_lift_off(law.kind);
  const bool held = memory.surface == surface;
  if (depth <= 0.0 && (separates || !held)) {
    if (!held) bar.stretch = stretch_bar;  // another surface's, untouched
    return bar;
  }
  const Vec3d& n = point.normal;
  const Vec3d& v = point.relative_velocity;
  const double spring = law.stiffness * std::max(point.area, 0.0);
  const double dashpot = 2.0 * law.damping * std::sqrt(spring * point.mass);
  const double approach = -n.dot(v);
  const Firmness firm = firmness_at(law, depth);
  double normal_force = spring * depth * firm.secant + dashpot * approach;
  const bool pulls = separates && normal_force < 0.0;
  if (pulls) normal_force = 0.0;

  double normal_bar = n.dot(force_bar);
  double spring_bar = 0.0;
  double dashpot_bar = 0.0;
  double approach_bar = 0.0;
  bar.normal = normal_force * force_bar;
  const bool smooth = !shape::resists_sliding(law.kind);
  if (!smooth && spring > 0.0) {
    const Vec3d sliding = v + approach * n;
    Vec3d before = Vec3d::Zero();
    if (held) before = Eigen::Map<const Vec3d>(memory.stretch.data());
    const Vec3d moved = before + dt * sliding;
    const Vec3d stretch = moved - n.dot(moved) * n;
    const Vec3d trial = -spring * stretch - dashpot * sliding;
    Vec3d trial_bar = force_bar;
    Vec3d projected_bar = stretch_bar;
    const double most = law.mu * normal_force;
    const double size = trial.norm();
    if (law.kind == shape::ContactKind::kFriction && size > most) {
      const double keep = most / size;
      const Vec3d kept_bar = force_bar - stretch_bar / spring;
      spring_bar += keep * stretch_bar.dot(trial) / (spring * spring);
      const double most_bar = kept_bar.dot(trial) / size;
      trial_bar = keep * (kept_bar - kept_bar.dot(trial) / (size * size) * trial);
      projected_bar.setZero();
      bar.mu = normal_force * most_bar;
      normal_bar += law.mu * most_bar;
    }
    projected_bar -= spring * trial_bar;
    spring_bar -= trial_bar.dot(stretch);
    dashpot_bar -= trial_bar.dot(sliding);
    const Vec3d moved_bar = projected_bar - n.dot(projected_bar) * n;
    bar.normal -= n.dot(moved) * projected_bar + n.dot(projected_bar) * moved;
    if (held) bar.stretch = moved_bar;
    const Vec3d sliding_bar = dt * moved_bar - dashpot * trial_bar;
    bar.relative_velocity = sliding_bar;
    approach_bar = n.dot(sliding_bar);
    bar.normal += approach * sliding_bar;
  } else if (smooth && held) {
    bar.stretch = stretch_bar;
  }
  if (pulls) normal_bar = 0.0;
  spring_bar += depth * firm.secant * normal_bar;
  const double depth_bar = spring * firm.tangent * normal_bar;
  dashpot_bar += approach * normal_bar;
  approach_bar += dashpot * normal_bar;
  bar.normal -= approach_bar * v;
  bar.relative_velocity -= approach_bar * n;
  if (spring > 0.0) {
    spring_bar += 0.5 * dashpot_bar * dashpot / spring;
    bar.mass = 0.5 * dashpot_bar * dashpot / point.mass;
    bar.damping = dashpot_bar * 2.0 * std::sqrt(spring * point.mass);
    bar.stiffness = spring_bar * point.area;
    bar.area = spring_bar * law.stiffness;
  }
  bar.radius = depth_bar;
  bar.distance = -depth_bar;
  return bar;
}

ContactPointCotangents contact_point_adjoint(const Vec3d& normal, const Mat3d& f, double volume,
                                             const ContactCotangents& bar) {
  const double edge = std::cbrt(volume);
  const Vec3d pulled = f.transpose() * normal;
  const double stretch = pulled.norm();
  const double det = f.determinant();
  // radius = ½ edge · stretch, area = det · V/(edge · stretch).
  const double stretch_bar =
      0.5 * edge * bar.radius - bar.area * det * volume / (edge * stretch * stretch);
  const Vec3d pulled_bar = stretch_bar / stretch * pulled;
  ContactPointCotangents out;
  out.deformation_gradient = bar.area * volume / (edge * stretch) * det * f.inverse().transpose() +
                             normal * pulled_bar.transpose();
  out.normal = f * pulled_bar;
  out.density = volume * bar.mass;
  return out;
}

}  // namespace matterfit::mpm
