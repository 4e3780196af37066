// SPDX-License-Identifier: GPL-3.0-or-later
// The stranger must be right by itself before a fit may be blamed for a difference to it.
#include "bench/reference_mpm.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "bench/reference_shape.hpp"

namespace matterfit::bench {
namespace {

constexpr double kCell = 0.02;

std::vector<Vec3d> block(int nx, int ny, int nz, const Vec3d& low) {
  std::vector<Vec3d> points;
  for (int i = 0; i < nx; ++i) {
    for (int j = 0; j < ny; ++j) {
      for (int k = 0; k < nz; ++k) {
        points.push_back(low + 0.5 * kCell * Vec3d(i + 0.5, j + 0.5, k + 0.5));
      }
    }
  }
  return points;
}

Vec3d centre(const ReferenceMpm& mpm) {
  Vec3d sum = Vec3d::Zero();
  for (const auto& p : mpm.particles()) sum += p.x;
  return sum / static_cast<double>(mpm.particles().size());
}

ReferenceMpm::Options options() {
  ReferenceMpm::Options result;
  result.dx = kCell;
  return result;
}

TEST(ReferenceMpm, FliesBallistically) {
  ReferenceMpm mpm(block(6, 6, 6, {0, 0, 1}), {0.4, -0.2, 0.5}, {0, 0, 0}, {}, options());
  const Vec3d start = centre(mpm);
  for (int i = 0; i < 1000; ++i) mpm.step();
  const Vec3d expected = start + Vec3d(0.04, -0.02, 0.05 - 0.5 * 9.81 * 0.01);
  EXPECT_LT((centre(mpm) - expected).norm(), 1e-9);
}

TEST(ReferenceMpm, KeepsAngularMomentum) {
  ReferenceMpm::Options free = options();
  free.gravity = 0.0;
  ReferenceMpm mpm(block(8, 6, 5, {0, 0, 1}), {0.1, 0, 0}, {1, 4, -2}, {}, free);
  // APIC: of the particles and of their affine fields, whose inertia is dx²/3.
  const auto angular = [&] {
    Vec3d sum = Vec3d::Zero();
    const Vec3d middle = centre(mpm);
    for (const auto& p : mpm.particles()) {
      const Mat3d& C = p.C;
      sum += (p.x - middle).cross(p.v) +
             kCell * kCell / 3.0 * Vec3d(C(2, 1) - C(1, 2), C(0, 2) - C(2, 0), C(1, 0) - C(0, 1));
    }
    return sum;
  };
  const Vec3d before = angular();
  for (int i = 0; i < 300; ++i) mpm.step();
  EXPECT_LT((angular() - before).norm() / before.norm(), 1e-3);
}

TEST(ReferenceMpm, RingsAtTheFrequencyOfABar) {
  // A bar free at both ends, long against the length of a node's influence: f = c/2L, ν = 0.
  ReferenceMaterial material;
  material.poisson_ratio = 0.0;
  ReferenceMpm::Options free = options();
  free.gravity = 0.0;
  constexpr int kLong = 64;
  constexpr double kLength = kLong * 0.5 * kCell;
  const double period = 2.0 * kLength / material.wave_speed(free.density);
  // Let it stretch by itself: a bar that turns about its middle oscillates about a longer length.
  ReferenceMpm mpm(block(8, 8, kLong, {0, 0, 0.5}), Vec3d::Zero(), {2, 0, 0}, material, free);
  const auto spread = [&] {
    const Vec3d middle = centre(mpm);
    double sum = 0.0;
    for (const auto& p : mpm.particles()) sum += (p.x - middle).norm();
    return sum;
  };
  double last = spread();
  bool growing = true;
  std::vector<double> turns;
  for (int step = 1; turns.size() < 2 && step < 6000; ++step) {
    mpm.step();
    const double now = spread();
    if (growing != (now > last)) {
      turns.push_back(step * free.dt);
      growing = !growing;
    }
    last = now;
  }
  ASSERT_EQ(turns.size(), 2U);
  EXPECT_NEAR((turns[1] - turns[0]) / (0.5 * period), 1.0, 0.05);
}

TEST(ReferenceMpm, GroundHoldsWholeNodes) {
  ReferenceMpm mpm(block(8, 8, 8, {0, 0, 0.05}), {1.0, 0, 0}, Vec3d::Zero(), {}, options());
  for (int i = 0; i < 6000; ++i) mpm.step();
  double lowest = 1.0;
  double fastest = 0.0;
  for (const auto& p : mpm.particles()) {
    lowest = std::min(lowest, p.x.z());
    if (p.x.z() < 0.5 * kCell) fastest = std::max(fastest, p.v.head<2>().norm());
  }
  EXPECT_GT(lowest, 0.0);
  EXPECT_LT(fastest, 0.1);
}

TEST(ReferenceShape, SamplesHaveTheirVolume) {
  for (const ReferenceShape& shape : reference_shapes()) {
    const Quatd turn(Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()));
    const std::vector<Vec3d> points = sample(shape, 0.01, turn, 0.008, 0.25, 1);
    EXPECT_NEAR(static_cast<double>(points.size()) * 5.12e-7, 0.01, 1e-4) << shape.name;
    double lowest = 1.0;
    for (const Vec3d& x : points) lowest = std::min(lowest, x.z());
    EXPECT_NEAR(lowest, 0.25, 1e-12) << shape.name;
  }
}

}  // namespace
}  // namespace matterfit::bench
