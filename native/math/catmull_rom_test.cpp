// SPDX-License-Identifier: GPL-3.0-or-later
#include "math/catmull_rom.hpp"

#include <gtest/gtest.h>

#include "base/vec.hpp"

namespace matterfit {
namespace {

TEST(CatmullRom, FollowsAParabola) {
  const auto at = [](double t) { return Vec3d(1.0 + t, 2.0 * t * t - t, 3.0); };
  for (const double s : {0.0, 0.3, 0.7, 1.0}) {
    EXPECT_LT((catmull_rom<Vec3d>(at(4.0), at(5.0), at(6.0), at(7.0), s) - at(5.0 + s)).norm(),
              1e-12);
  }
}

TEST(CatmullRom, KeepsItsSlopeAcrossAFrame) {
  const double x[] = {0.0, 1.0, -2.0, 5.0, 4.0};
  const double h = 1e-7;
  const double before = (x[2] - catmull_rom(x[0], x[1], x[2], x[3], 1.0 - h)) / h;
  const double after = (catmull_rom(x[1], x[2], x[3], x[4], h) - x[2]) / h;
  EXPECT_NEAR(before, 0.5 * (x[3] - x[1]), 1e-5);
  EXPECT_NEAR(after, before, 1e-5);
}

}  // namespace
}  // namespace matterfit
