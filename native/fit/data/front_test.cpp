// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/front.hpp"

#include <gtest/gtest.h>

#include <random>

namespace matterfit::fit {
namespace {

constexpr double kFrontSeparation = 0.01;

/// A box of particles from 0 to `length` along x.
std::vector<Vec3d> box_to(double length) {
  std::vector<Vec3d> box;
  for (double x = 0.5 * kFrontSeparation; x < length; x += kFrontSeparation) {
    for (double y = 0.5 * kFrontSeparation; y < 0.05; y += kFrontSeparation)
      box.emplace_back(x, y, 0.2);
  }
  return box;
}

TEST(Front, OfABoxIsItsFace) {
  const Front front(Vec3d::UnitX(), kFrontSeparation);
  EXPECT_NEAR(front.reach(box_to(0.2)), 0.2, 0.2 * kFrontSeparation);
  EXPECT_NEAR(front.reach(box_to(0.3)) - front.reach(box_to(0.2)), 0.1, 1e-6);
  EXPECT_NEAR(Front(-Vec3d::UnitX(), kFrontSeparation).reach(box_to(0.2)), 0.0,
              0.2 * kFrontSeparation);
}

TEST(Front, ReplacesWhatIsAlongItsDirectionOnly) {
  const Front front(Vec3d::UnitX(), kFrontSeparation);
  EXPECT_EQ(front.moved(Vec3d(1.0, 2.0, 3.0), 5.0), Vec3d(5.0, 2.0, 3.0));
}

/// By central differences, and by the speed along a motion.
TEST(Front, KnowsItsDerivative) {
  std::mt19937 engine(4);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<Vec3d> x = box_to(0.1);
  std::vector<Vec3d> v(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] += 0.3 * kFrontSeparation * Vec3d(uniform(engine), uniform(engine), uniform(engine));
    v[i] = Vec3d(uniform(engine), uniform(engine), uniform(engine));
  }
  const Front front(Vec3d(0.6, 0.8, 0.0), kFrontSeparation);
  const double h = 1e-7;
  std::vector<Vec3d> after = x;
  std::vector<Vec3d> before = x;
  for (std::size_t i = 0; i < x.size(); ++i) {
    after[i] += h * v[i];
    before[i] -= h * v[i];
  }
  const double slope = (front.reach(after) - front.reach(before)) / (2.0 * h);
  EXPECT_NEAR(front.speed(x, v), slope, 1e-6 * std::abs(slope));
  std::vector<Vec3d> bars(x.size(), Vec3d::Zero());
  front.spread(2.0, x, bars);
  double dot = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) dot += bars[i].dot(v[i]);
  EXPECT_NEAR(dot, 2.0 * slope, 2e-6 * std::abs(slope));
}

}  // namespace
}  // namespace matterfit::fit
