// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/surface_points.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace matterfit::fit {
namespace {

/// A cube of 12 × 12 × 12 particles whose faces are the planes 0 and 12, moved at random by
/// `jitter`.
Points cube(double jitter) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-jitter, jitter);
  Points points;
  for (int i = 0; i < 12; ++i)
    for (int j = 0; j < 12; ++j)
      for (int k = 0; k < 12; ++k) {
        points.push_back(Vec3d(i + 0.5, j + 0.5, k + 0.5) +
                         Vec3d(uniform(random), uniform(random), uniform(random)));
      }
  return points;
}

const std::vector<double> kUnit(12 * 12 * 12, 1.0);

double to_faces(const Vec3d& x) {
  const Vec3d outside = (x - Vec3d::Constant(6.0)).cwiseAbs() - Vec3d::Constant(6.0);
  return outside.maxCoeff();
}

TEST(SurfacePoints, OfALatticeLieOnItsFaces) {
  Arena arena(2);
  const Points surface = surface_points(cube(0.0), kUnit, arena);
  EXPECT_EQ(surface.size(), 12U * 12 * 12 - 10 * 10 * 10);
  int on_a_face = 0;
  for (const Vec3d& x : surface) {
    EXPECT_LT(std::abs(to_faces(x)), 0.25);
    on_a_face += std::abs(to_faces(x)) < 1e-9 ? 1 : 0;
  }
  EXPECT_GE(on_a_face, 6 * 8 * 8);
}

TEST(SurfacePoints, OfJitteredParticlesLieNearTheFaces) {
  Arena arena(1);
  const Points surface = surface_points(cube(0.3), kUnit, arena);
  EXPECT_GT(surface.size(), 500U);
  int inside = 0;
  for (const Vec3d& x : surface) inside += to_faces(x) < -0.8 ? 1 : 0;
  EXPECT_LT(inside, int(surface.size() / 20));
}

TEST(SurfacePoints, ScaleWithTheParticles) {
  Arena arena(1);
  Points small = cube(0.0);
  for (Vec3d& x : small) x *= 0.01;
  const Points surface = surface_points(small, std::vector<double>(small.size(), 1e-6), arena);
  const Points large = surface_points(cube(0.0), kUnit, arena);
  ASSERT_EQ(surface.size(), large.size());
  for (std::size_t i = 0; i < surface.size(); ++i) {
    EXPECT_LT((surface[i] - 0.01 * large[i]).norm(), 1e-12);
  }
}

TEST(SurfacePoints, OfNothingAreNone) {
  Arena arena(1);
  EXPECT_TRUE(surface_points({}, {}, arena).empty());
}

}  // namespace
}  // namespace matterfit::fit
