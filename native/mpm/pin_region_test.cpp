// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/pin_region.hpp"

#include <gtest/gtest.h>

namespace matterfit::mpm {
namespace {

TEST(Region, DistancesOfEachShape) {
  Pin pin;
  pin.region = Pin::Region::kBox;
  pin.low = Vec3d(0, 0, 0);
  pin.high = Vec3d(1, 2, 3);
  EXPECT_DOUBLE_EQ(region_distance(pin, Vec3d(4, 6, 1)).distance, 5.0);
  EXPECT_DOUBLE_EQ(region_distance(pin, Vec3d(0.25, 1, 1)).distance, -0.25);
  pin.region = Pin::Region::kSphere;
  pin.point = Vec3d(0, 0, 1);
  pin.radius = 1.0;
  EXPECT_DOUBLE_EQ(region_distance(pin, Vec3d(0, 0, 4)).distance, 2.0);
  EXPECT_EQ(region_distance(pin, Vec3d(0, 0, 4)).nearest, Vec3d(0, 0, 2));
  pin.region = Pin::Region::kPoints;
  pin.points = {Vec3d(0, 0, 0), Vec3d(5, 0, 0)};
  pin.radius = 0.5;
  EXPECT_DOUBLE_EQ(region_distance(pin, Vec3d(3, 0, 0)).distance, 1.5);
  pin.region = Pin::Region::kAll;
  EXPECT_LT(region_distance(pin, Vec3d(3, 0, 0)).distance, 0.0);
}

}  // namespace
}  // namespace matterfit::mpm
