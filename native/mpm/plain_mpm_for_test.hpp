// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "material/classical/point_law.hpp"
#include "mpm/initial_velocity.hpp"
#include "mpm/scene.hpp"

namespace matterfit::mpm {

/// MLS-MPM with APIC of the first body of a scene, a node at a time, in double: what the kernels
/// are held against, and what knows its own angular momentum.
class PlainMpm {
 public:
  /// Kirchhoff stress [Pa] after F ← `step` F over `dt` [s].
  using Law = std::function<Mat3d(const Mat3d& step, material::PointState& state, double dt)>;

  PlainMpm(const Scene& scene, Law law)
      : dx_(scene.dx),
        gravity_(scene.gravity.at(0.0)),
        density_(scene.bodies[0].density),
        law_(std::move(law)) {
    const Body& body = scene.bodies[0];
    const Vec3d center = center_of_volume(body);
    for (std::size_t p = 0; p < body.rest.size(); ++p) {
      particles_.push_back({body.rest[p],
                            start_velocity(body, p, center),
                            spin_matrix(body.spin),
                            Mat3d::Zero(),
                            body.volumes[p],
                            {}});
    }
  }

  struct Particle {
    Vec3d x, v;
    Mat3d c, tau;
    double volume;
    material::PointState state;
  };

  void step(double dt) {
    std::map<std::array<int, 3>, std::pair<double, Vec3d>> nodes;
    for (const Particle& p : particles_) {
      const double mass = density_ * p.volume;
      const Mat3d affine = mass * p.c - dt * p.volume * 4.0 / (dx_ * dx_) * p.tau;
      each_node(p.x, [&](const std::array<int, 3>& node, double w, const Vec3d& arm) {
        auto& [m, momentum] = nodes.try_emplace(node, 0.0, Vec3d::Zero()).first->second;
        m += w * mass;
        momentum += w * (mass * p.v + affine * arm);
      });
    }
    const double kick = 0.5 * (last_ + dt);
    for (Particle& p : particles_) {
      p.v.setZero();
      p.c.setZero();
      each_node(p.x, [&](const std::array<int, 3>& node, double w, const Vec3d& arm) {
        const auto& [m, momentum] = nodes.at(node);
        const Vec3d v = momentum / m + kick * gravity_;
        p.v += w * v;
        p.c += 4.0 / (dx_ * dx_) * w * v * arm.transpose();
      });
      p.x += dt * p.v;
      p.tau = law_(Mat3d::Identity() + dt * p.c, p.state, dt);
    }
    last_ = dt;
  }

  /// The angular momentum of the particles and of their affine velocities.
  [[nodiscard]] Vec3d angular_momentum() const {
    Vec3d sum = Vec3d::Zero();
    for (const Particle& p : particles_) {
      const double mass = density_ * p.volume;
      sum += mass * (p.x.cross(p.v) + 0.25 * dx_ * dx_ * twice_axial(p.c));
    }
    return sum;
  }
  /// What the stress turns the body by in the next substep of `dt`.
  [[nodiscard]] Vec3d angular_impulse(double dt) const {
    Vec3d sum = Vec3d::Zero();
    for (const Particle& p : particles_) sum -= dt * p.volume * twice_axial(p.tau);
    return sum;
  }
  [[nodiscard]] const std::vector<Particle>& particles() const { return particles_; }

 private:
  static Vec3d twice_axial(const Mat3d& m) {
    return {m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1)};
  }
  template <class Visit>
  void each_node(const Vec3d& x, const Visit& visit) const {
    int base[3];
    double w[3][3];
    for (int axis = 0; axis < 3; ++axis) {
      base[axis] = static_cast<int>(std::floor(x[axis] / dx_ - 0.5));
      const double f = x[axis] / dx_ - base[axis];
      w[axis][0] = 0.5 * (1.5 - f) * (1.5 - f);
      w[axis][1] = 0.75 - (f - 1.0) * (f - 1.0);
      w[axis][2] = 0.5 * (f - 0.5) * (f - 0.5);
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 3; ++k) {
          const std::array<int, 3> node{base[0] + i, base[1] + j, base[2] + k};
          visit(node, w[0][i] * w[1][j] * w[2][k], dx_ * Vec3d(node[0], node[1], node[2]) - x);
        }
  }

  double dx_;
  Vec3d gravity_;
  double density_;
  Law law_;
  std::vector<Particle> particles_;
  double last_ = 0.0;
};

}  // namespace matterfit::mpm
