// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/particle_volumes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

/// Moments of filled bodies against those of their shapes.
namespace matterfit::capture {
namespace {

FillOptions lattice_of_one() {
  FillOptions options;
  options.separation = 1.0;
  options.anchor = Vec3d::Zero();
  return options;
}

Vec3d middle_of(const FilledBody& body) {
  Vec3d sum = Vec3d::Zero();
  for (std::size_t i = 0; i < body.positions.size(); ++i) {
    sum += body.volumes[i] * body.positions[i];
  }
  return sum / std::accumulate(body.volumes.begin(), body.volumes.end(), 0.0);
}

/// ∫ (n · (x − centre))² over a body of which each particle fills a cube of the lattice.
double second_moment(const FilledBody& body, const Vec3d& centre, const Vec3d& n) {
  const double own = body.lattice.spacing * body.lattice.spacing / 12.0;
  double moment = 0.0;
  for (std::size_t i = 0; i < body.positions.size(); ++i) {
    moment += body.volumes[i] * (std::pow(n.dot(body.positions[i] - centre), 2) + own);
  }
  return moment;
}

/// Wherever the lattice cuts its outer rows.
TEST(ParticleVolumes, AThinBarKeepsItsBendingStiffness) {
  for (const double cut : {0.05, 0.2, 0.29, 0.31, 0.42, 0.48, 0.52, 0.7, 0.95}) {
    const double half = 2.0 + cut;  // in cells
    const FillOptions options = lattice_of_one();
    const auto bar = fill_box(Vec3d(0, 0, -half), Vec3d(20, 5, half), options);
    const double exact = 100.0 * std::pow(2.0 * half, 3) / 12.0;
    EXPECT_NEAR(second_moment(bar, Vec3d(10, 2.5, 0), Vec3d::UnitZ()), exact, 0.06 * exact) << cut;
  }
}

/// Six cells across, anywhere in the lattice.
TEST(ParticleVolumes, MomentsOfInertiaAreTheShapes) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(-0.5, 0.5);
  const Vec3d half(3.0, 4.5, 2.4);
  for (int draw = 0; draw < 8; ++draw) {
    FillOptions options = lattice_of_one();
    options.anchor = Vec3d(unit(random), unit(random), unit(random));
    options.axes = Quatd(unit(random), unit(random), unit(random), unit(random)).normalized();
    const auto ball = fill_sphere(Vec3d::Zero(), 3.0, options);
    EXPECT_LT(middle_of(ball).norm(), 0.02);
    const auto box = fill_box(-half, half, options);
    EXPECT_LT(middle_of(box).norm(), 0.02);
    for (int axis = 0; axis < 3; ++axis) {
      const double of_ball = 4.0 / 15.0 * std::numbers::pi * std::pow(3.0, 5);
      EXPECT_NEAR(second_moment(ball, Vec3d::Zero(), Vec3d::Unit(axis)), of_ball, 0.025 * of_ball);
      const double of_box = 8.0 * half.prod() * std::pow(half[axis], 2) / 3.0;
      EXPECT_NEAR(second_moment(box, Vec3d::Zero(), Vec3d::Unit(axis)), of_box, 0.03 * of_box)
          << axis;
    }
  }
}

}  // namespace
}  // namespace matterfit::capture
