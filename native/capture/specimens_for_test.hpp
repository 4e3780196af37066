// SPDX-License-Identifier: GPL-3.0-or-later
// Bodies of particles for tests of bindings and caches.
#pragma once

#include <cmath>
#include <functional>
#include <vector>

#include "base/vec.hpp"
#include "capture/particles.hpp"

namespace matterfit::capture::test_bodies {

/// Particles with what a ParticleView borrows.
struct Specimen {
  std::vector<Vec3d> rest;
  std::vector<double> volumes;
  std::vector<Vec3f> positions;
  std::vector<Vec3f> velocities;
  std::vector<Mat3f> deformation;
  double separation = 0.0;

  /// x = A X + b, v = W x.
  void move(const Mat3d& a, const Vec3d& b, const Mat3d& w = Mat3d::Zero()) {
    for (std::size_t i = 0; i < rest.size(); ++i) {
      const Vec3d x = a * rest[i] + b;
      positions[i] = x.cast<float>();
      velocities[i] = (w * x).cast<float>();
      deformation[i] = a.cast<float>();
    }
  }
  [[nodiscard]] ParticleView view() const {
    return {"blob", positions, velocities, deformation, volumes, separation, Quatd::Identity()};
  }
};

/// Lattice points of spacing h (cell centres) where `inside` holds, in [-extent, extent]³.
inline Specimen lattice_body(double h, double extent,
                             const std::function<bool(const Vec3d&)>& inside) {
  Specimen body;
  body.separation = h;
  const int n = static_cast<int>(std::ceil(extent / h));
  for (int i = -n; i < n; ++i)
    for (int j = -n; j < n; ++j)
      for (int k = -n; k < n; ++k) {
        const Vec3d x = h * (Vec3d(i, j, k) + Vec3d::Constant(0.5));
        if (inside(x)) body.rest.push_back(x);
      }
  body.volumes.assign(body.rest.size(), h * h * h);
  body.positions.resize(body.rest.size());
  body.velocities.resize(body.rest.size());
  body.deformation.resize(body.rest.size());
  body.move(Mat3d::Identity(), Vec3d::Zero());
  return body;
}

inline Specimen ball(double h, double radius) {
  return lattice_body(h, radius, [=](const Vec3d& x) { return x.norm() < radius; });
}

inline Specimen cube(double h, double half) {
  return lattice_body(h, half, [](const Vec3d&) { return true; });
}

}  // namespace matterfit::capture::test_bodies
