// SPDX-License-Identifier: GPL-3.0-or-later
#include "shape/collider.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "base/error.hpp"

namespace matterfit::shape {
namespace {

Keyed<Pose> turning_pose() {
  Keyed<Pose> pose;
  pose.times = {0.0, 0.5, 1.5};
  const Vec3d axis = Vec3d(1, 2, -1).normalized();
  pose.values = {{Vec3d(0.1, 0, 0.2), Quatd(Eigen::AngleAxisd(0.3, axis))},
                 {Vec3d(0.4, 0.1, 0), Quatd(Eigen::AngleAxisd(1.4, Vec3d::UnitY()))},
                 {Vec3d(0, 0, 0), Quatd(Eigen::AngleAxisd(-0.7, Vec3d::UnitX()))}};
  return pose;
}

/// A first-order check that holds for every distance field: |∇d| = 1, ∇d = normal, and the point
/// moved by −d·n is on the surface.
void expect_distance_field(const Collider& collider, double time, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const double step = 1e-6;
  int tested = 0;
  for (int sample = 0; sample < 400; ++sample) {
    const Vec3d x(unit(random), unit(random), unit(random));
    const SurfacePoint here = collider.closest(x, time);
    ASSERT_NEAR(here.normal.norm(), 1.0, 1e-12);
    Vec3d gradient;
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3d e = Vec3d::Unit(axis) * step;
      gradient[axis] =
          (collider.closest(x + e, time).distance - collider.closest(x - e, time).distance) /
          (2 * step);
    }
    if (std::abs(gradient.norm() - 1.0) > 1e-5) continue;  // across the medial axis
    ++tested;
    EXPECT_NEAR((gradient - here.normal).norm(), 0.0, 2e-5) << x.transpose();
    EXPECT_NEAR(collider.closest(x - here.distance * here.normal, time).distance, 0.0, 1e-12);
  }
  EXPECT_GT(tested, 390);
}

/// The distance of a point that moves with the surface does not change to first order, so
/// ∂d/∂t + velocity·normal = 0.
void expect_velocity(const Collider& collider, double time) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-0.6, 0.6);
  const double step = 1e-6;
  for (int sample = 0; sample < 100; ++sample) {
    const Vec3d x(unit(random), unit(random), unit(random));
    const SurfacePoint here = collider.closest(x, time);
    const double rate =
        (collider.closest(x, time + step).distance - collider.closest(x, time - step).distance) /
        (2 * step);
    EXPECT_NEAR(rate, -here.velocity.dot(here.normal), 1e-5) << x.transpose();
  }
}

TEST(Collider, KnownDistances) {
  const Contact contact;
  const auto ground = make_plane("ground", contact, Vec3d(0, 0, 0.5), Vec3d(0, 0, 3));
  EXPECT_DOUBLE_EQ(ground->closest(Vec3d(4, 5, 0.2), 0).distance, -0.3);
  EXPECT_EQ(ground->closest(Vec3d(4, 5, 0.2), 0).normal, Vec3d(0, 0, 1));
  EXPECT_EQ(ground->name(), "ground");
  EXPECT_TRUE(std::isinf(ground->band()));

  const Keyed<Pose> at(Pose{Vec3d(1, 0, 0), Quatd::Identity()});
  const auto sphere = make_sphere("ball", contact, 0.25, at);
  EXPECT_DOUBLE_EQ(sphere->closest(Vec3d(1, 0, 1), 0).distance, 0.75);
  EXPECT_DOUBLE_EQ(sphere->closest(Vec3d(1, 0, 0), 0).distance, -0.25);

  const auto box = make_box("box", contact, Vec3d(1, 2, 3), at);
  EXPECT_DOUBLE_EQ(box->closest(Vec3d(1, 0, 2.5), 0).distance, -0.5);
  EXPECT_DOUBLE_EQ(box->closest(Vec3d(1 + 1 + 3, 2 + 4, 0), 0).distance, 5.0);
  EXPECT_NEAR((box->closest(Vec3d(5, 6, 0), 0).normal - Vec3d(0.6, 0.8, 0)).norm(), 0, 1e-15);

  const auto capsule = make_capsule("rod", contact, 0.1, 0.5, at);
  EXPECT_DOUBLE_EQ(capsule->closest(Vec3d(1, 0.3, 0.2), 0).distance, 0.2);
  EXPECT_DOUBLE_EQ(capsule->closest(Vec3d(1, 0, 0.9), 0).distance, 0.3);
}

TEST(Collider, NormalIsTheGradientInsideAndOutside) {
  const Contact contact;
  const auto pose = turning_pose();
  expect_distance_field(*make_plane("p", contact, Vec3d(0.1, 0, 0), Vec3d(1, 1, 2), pose), 0.2, 1);
  expect_distance_field(*make_sphere("s", contact, 0.4, pose), 0.2, 2);
  expect_distance_field(*make_box("b", contact, Vec3d(0.3, 0.5, 0.4), pose), 0.8, 3);
  expect_distance_field(*make_capsule("c", contact, 0.2, 0.5, pose), 0.8, 4);
}

TEST(Collider, VelocityIsTheDerivativeOfTheInterpolation) {
  const Contact contact;
  const auto pose = turning_pose();
  for (const double time : {0.1, 0.4, 0.7, 1.4}) {
    expect_velocity(*make_plane("p", contact, Vec3d(0.1, 0, 0), Vec3d(1, 1, 2), pose), time);
    expect_velocity(*make_sphere("s", contact, 0.4, pose), time);
    expect_velocity(*make_box("b", contact, Vec3d(0.3, 0.5, 0.4), pose), time);
    expect_velocity(*make_capsule("c", contact, 0.2, 0.5, pose), time);
  }
}

TEST(Collider, TangentialVelocityOfATurningSphere) {
  Keyed<Pose> pose;
  pose.times = {0.0, 1.0};
  pose.values = {{}, {Vec3d::Zero(), Quatd(Eigen::AngleAxisd(2.0, Vec3d::UnitZ()))}};
  const auto sphere = make_sphere("s", Contact{}, 0.5, pose);
  const Vec3d velocity = sphere->closest(Vec3d(0.7, 0, 0), 0.3).velocity;
  EXPECT_NEAR((velocity - Vec3d(0, 2.0 * 0.5, 0)).norm(), 0.0, 1e-12);
}

TEST(Collider, HeldAndStepKeysDoNotMove) {
  auto pose = turning_pose();
  for (const double time : {-1.0, 1.5, 3.0}) {
    const SurfacePoint point =
        make_box("b", Contact{}, Vec3d(1, 1, 1), pose)->closest(Vec3d(2, 0.3, 0.1), time);
    EXPECT_TRUE(point.velocity.isZero(0.0)) << time;
  }
  pose.step = true;
  const auto box = make_box("b", Contact{}, Vec3d(1, 1, 1), pose);
  EXPECT_TRUE(box->closest(Vec3d(2, 0.3, 0.1), 0.2).velocity.isZero(0.0));
  EXPECT_EQ(box->closest(Vec3d(2, 0.3, 0.1), 0.2).distance,
            box->closest(Vec3d(2, 0.3, 0.1), 0.49).distance);
}

TEST(Collider, PoseAgreesWithKeyed) {
  const auto pose = turning_pose();
  const auto sphere = make_sphere("s", Contact{}, 0.1, pose);
  const auto box = make_box("b", Contact{}, Vec3d(0.1, 0.2, 0.3), pose);
  for (const double time : {0.0, 0.13, 0.5, 1.1, 2.0}) {
    const Pose expected = pose.at(time);
    EXPECT_NEAR(sphere->closest(expected.position, time).distance, -0.1, 1e-12);
    const Vec3d corner = expected.rotation * Vec3d(0.1, 0.2, 0.3) + expected.position;
    EXPECT_NEAR(box->closest(corner, time).distance, 0.0, 1e-12);
  }
}

TEST(Collider, RefusesNonsense) {
  EXPECT_THROW((void)make_sphere("s", Contact{}, 0.0, Keyed<Pose>(Pose{})), Error);
  EXPECT_THROW((void)make_box("b", Contact{}, Vec3d(1, -1, 1), Keyed<Pose>(Pose{})), Error);
  EXPECT_THROW((void)make_plane("p", Contact{}, Vec3d::Zero(), Vec3d::Zero()), Error);
  EXPECT_THROW((void)make_sphere("s", Contact{}, 1.0, Keyed<Pose>()), Error);
  auto pose = turning_pose();
  pose.times = {0, 1, 1};
  EXPECT_THROW((void)make_sphere("s", Contact{}, 1.0, pose), Error);
}

}  // namespace
}  // namespace matterfit::shape
