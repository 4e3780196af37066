// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench/reference_shape.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/random.hpp"

namespace matterfit::bench {
namespace {

using std::numbers::pi;

bool in_box(const Vec3d& x, const Vec3d& low, const Vec3d& high) {
  return (x.array() >= low.array()).all() && (x.array() <= high.array()).all();
}

bool in_sphere(const Vec3d& x) { return x.squaredNorm() <= 1.0; }

bool in_brick(const Vec3d& x) { return in_box(x, {-1, -0.8, -0.65}, {1, 0.8, 0.65}); }

bool in_tee(const Vec3d& x) {
  return in_box(x, {-1.5, -0.5, 0.5}, {1.5, 0.5, 1.5}) ||
         in_box(x, {-0.5, -0.5, -1.5}, {0.5, 0.5, 0.5});
}

/// Three bars through one another.
bool in_cross(const Vec3d& x) {
  return in_box(x, {-1.5, -0.5, -0.5}, {1.5, 0.5, 0.5}) ||
         in_box(x, {-0.5, -1.5, -0.5}, {0.5, 1.5, 0.5}) ||
         in_box(x, {-0.5, -0.5, -1.5}, {0.5, 0.5, 1.5});
}

bool in_torus(const Vec3d& x) {
  const double ring = std::hypot(x.x(), x.y()) - 2.0;
  return ring * ring + x.z() * x.z() <= 1.0;
}

/// An ellipsoid of revolution that is thicker above.
bool in_egg(const Vec3d& x) {
  const double s = x.z() / 1.3;
  const double wider = 1.0 + 0.25 * s;
  return std::abs(s) <= 1.0 && x.x() * x.x() + x.y() * x.y() <= (1.0 - s * s) * wider * wider;
}

bool in_cylinder(const Vec3d& x) {
  return std::abs(x.z()) <= 1.0 && x.x() * x.x() + x.y() * x.y() <= 1.0;
}

bool in_ell(const Vec3d& x) {
  return in_box(x, {-1.5, -0.5, -1.5}, {1.5, 0.5, -0.5}) ||
         in_box(x, {-1.5, -0.5, -0.5}, {-0.5, 0.5, 1.5});
}

bool in_cone(const Vec3d& x) {
  const double radius = 1.0 - 0.35 * (x.z() + 1.0);
  return std::abs(x.z()) <= 1.0 && x.x() * x.x() + x.y() * x.y() <= radius * radius;
}

bool in_capsule(const Vec3d& x) {
  const double along = std::clamp(x.z(), -1.0, 1.0);
  return (x - Vec3d(0, 0, along)).squaredNorm() <= 1.0;
}

bool in_ellipsoid(const Vec3d& x) {
  return x.cwiseQuotient(Vec3d(1.3, 1.0, 0.75)).squaredNorm() <= 1.0;
}

/// A cone with its tip cut off at z = .8, and above that a ball.
bool in_pawn(const Vec3d& x) {
  if (x.z() > 0.8) return (x - Vec3d(0, 0, 1.2)).squaredNorm() <= 0.36;
  const double radius = 1.0 - 0.35 * (x.z() + 1.2);
  return x.z() >= -1.2 && x.x() * x.x() + x.y() * x.y() <= radius * radius;
}

}  // namespace

const std::vector<ReferenceShape>& reference_shapes() {
  static const std::vector<ReferenceShape> shapes = {
      {"sphere", {1, 1, 1}, 4.0 / 3.0 * pi, in_sphere},
      {"box", {1, 0.8, 0.65}, 4.16, in_brick},
      {"tee", {1.5, 0.5, 1.5}, 5.0, in_tee},
      {"cross", {1.5, 1.5, 1.5}, 7.0, in_cross},
      {"torus", {3, 3, 1}, 4.0 * pi * pi, in_torus},
      // π · 1.3 ∫ (1 − s²)(1 + s/4)² ds over −1 … 1
      {"egg", {1.1, 1.1, 1.3}, 1.3 * pi * 1.35, in_egg},
      {"cylinder", {1, 1, 1}, 2.0 * pi, in_cylinder},
      {"ell", {1.5, 0.5, 1.5}, 5.0, in_ell},
      {"cone", {1, 1, 1}, 2.0 / 3.0 * pi * 1.39, in_cone},
      {"capsule", {1, 1, 2}, 10.0 / 3.0 * pi, in_capsule},
      {"ellipsoid", {1.3, 1.0, 0.75}, 1.3 * pi, in_ellipsoid},
      // 2π/3 (1 + .3 + .3²) and π ∫ (.36 − t²) dt over −.4 … .6
      {"pawn", {1, 1, 1.8}, (2.0 / 3.0 * 1.39 + 0.8 / 3.0) * pi, in_pawn},
  };
  return shapes;
}

std::vector<Vec3d> sample(const ReferenceShape& shape, double volume, const Quatd& turn,
                          double spacing, double clearance, std::uint64_t seed) {
  const double scale = std::cbrt(volume / shape.volume);
  const double reach = scale * shape.half_extents.norm();
  const int cells = static_cast<int>(std::ceil(reach / spacing));
  Random random(seed);
  std::vector<Vec3d> points;
  double lowest = reach;
  for (int i = -cells; i < cells; ++i) {
    for (int j = -cells; j < cells; ++j) {
      for (int k = -cells; k < cells; ++k) {
        const double u = random.uniform();
        const double v = random.uniform();
        const double w = random.uniform();
        const Vec3d x = spacing * Vec3d(i + u, j + v, k + w);
        if (!shape.inside(turn.conjugate() * x / scale)) continue;
        points.push_back(x);
        lowest = std::min(lowest, x.z());
      }
    }
  }
  for (Vec3d& x : points) x.z() += clearance - lowest;
  return points;
}

}  // namespace matterfit::bench
