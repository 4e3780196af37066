// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <utility>

#include "base/vec.hpp"
#include "mpm/scene.hpp"

namespace matterfit::bench {

inline constexpr double kSeparation = 0.01;
inline constexpr double kDensity = 1000.0;
inline constexpr double kYoungsModulus = 1e5;
inline constexpr double kPoissonRatio = 0.3;
inline constexpr double kDt = 2e-4;
inline constexpr int kClearanceCells = 4;  // of air below the cube, and to the sides
// Rates of the initial motion: without strain the polar decomposition would end at once, which no
// real scene lets it do.
inline constexpr double kStretchRate = 3.0;  // [1/s]
inline constexpr double kTwistRate = 3.0;    // [rad/s] between bottom and top
inline constexpr double kFall = -0.5;        // [m/s]

/// Particles along an edge of a cube of about `particles`.
inline int edge_of(std::size_t particles) {
  return static_cast<int>(std::lround(std::cbrt(static_cast<double>(particles))));
}

/// Initial velocity of the particle at `p`, both in the cube's frame of [0, 1]³ times its side.
inline Vec3d initial_velocity(const Vec3d& p, double side) {
  const Vec3d r = p - Vec3d::Constant(0.5 * side);
  const double spin = kTwistRate * (p.z() / side - 0.5);
  return {kStretchRate * r.x() - spin * r.y(), -kStretchRate * r.y() + spin * r.x(), kFall};
}

/// The formulations by the names that documents have for them.
inline const std::map<std::string, mpm::Formulation>& formulations() {
  static const std::map<std::string, mpm::Formulation> kAll{
      {"total", mpm::Formulation::kTotal},
      {"updated", mpm::Formulation::kUpdated},
      {"renewed", mpm::Formulation::kRenewed}};
  return kAll;
}

/// A cube of jelly, stretched and twisted, that falls on the ground `clearance` cells below it; ten
/// substeps a frame.
inline mpm::Scene jelly(int edge, mpm::Formulation formulation, int clearance) {
  mpm::Scene scene;
  scene.fps = 1.0 / (10.0 * kDt);  // ten substeps a frame
  scene.end_frame = 1 << 28;
  scene.dx = 2.0 * kSeparation;
  scene.dt = kDt;
  mpm::Body body;
  body.name = "jelly";
  body.material.law = material::Law::kFixedCorotated;
  body.material.youngs_modulus = kYoungsModulus;
  body.material.poisson_ratio = kPoissonRatio;
  body.density = kDensity;
  body.formulation = formulation;
  body.lattice.spacing = kSeparation;
  body.lattice.regular = true;
  body.lattice.origin = Vec3d(0, 0, clearance * 2.0 * kSeparation);
  for (int i = 0; i < edge; ++i) {
    for (int j = 0; j < edge; ++j) {
      for (int k = 0; k < edge; ++k) {
        const Vec3d p = kSeparation * Vec3d(i + 0.5, j + 0.5, k + 0.5);
        body.rest.push_back(body.lattice.origin + p);
        body.particle_velocities.push_back(initial_velocity(p, edge * kSeparation));
      }
    }
  }
  body.volumes.assign(body.rest.size(), kSeparation * kSeparation * kSeparation);
  scene.bodies.push_back(std::move(body));
  shape::Contact contact;
  scene.colliders.push_back(shape::make_plane("ground", contact, Vec3d::Zero(), Vec3d::UnitZ()));
  return scene;
}

}  // namespace matterfit::bench
