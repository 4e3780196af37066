// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/camera_pose.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

namespace matterfit::fit {
namespace {

/// At (1, 2, 3), looking along the world's y, its own y downwards.
splat::Camera camera() {
  splat::Camera camera;
  camera.width = 100;
  camera.height = 80;
  camera.fx = camera.fy = 120.0;
  camera.cx = 50.0;
  camera.cy = 40.0;
  camera.rotation.row(0) = Vec3d::UnitX();
  camera.rotation.row(1) = -Vec3d::UnitZ();
  camera.rotation.row(2) = Vec3d::UnitY();
  camera.translation = -(camera.rotation * Vec3d(1, 2, 3));
  return camera;
}

Eigen::Vector2d seen(const splat::Camera& by, const Vec3d& x) {
  const Vec3d t = by.rotation * x + by.translation;
  return {by.fx * t.x() / t.z() + by.cx, by.fy * t.y() / t.z() + by.cy};
}

TEST(CameraPose, NothingChangesNothing) {
  const splat::Camera same = posed(camera(), {});
  EXPECT_EQ(same.rotation, camera().rotation);
  EXPECT_EQ(same.translation, camera().translation);
  EXPECT_EQ(same.fx, camera().fx);
}

TEST(CameraPose, ShiftsInTheWorldAndTurnsInItsOwnAxes) {
  CameraPose pose;
  pose.shift = Vec3d(0.1, -0.2, 0.3);
  pose.turn = Vec3d(0.02, -0.01, 0.03);
  pose.focal = 0.05;
  const splat::Camera moved = posed(camera(), pose);
  EXPECT_LT((moved.centre() - Vec3d(1.1, 1.8, 3.3)).norm(), 1e-12);
  EXPECT_LT((moved.rotation * moved.rotation.transpose() - Mat3d::Identity()).norm(), 1e-12);
  EXPECT_DOUBLE_EQ(moved.fx, 126.0);
  EXPECT_DOUBLE_EQ(moved.fy, 126.0);
  // Panned to the right (about its y, which points down), it sees all farther left.
  CameraPose pan;
  pan.turn = Vec3d(0, 0.01, 0);
  const Vec3d ahead(1, 4, 3);
  EXPECT_NEAR(seen(posed(camera(), pan), ahead).x(), 50.0 - 120.0 * std::tan(0.01), 1e-9);
  EXPECT_NEAR(seen(posed(camera(), pan), ahead).y(), 40.0, 1e-9);
}

}  // namespace
}  // namespace matterfit::fit
