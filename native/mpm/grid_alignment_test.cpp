// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/grid_alignment.hpp"

#include <gtest/gtest.h>

namespace matterfit::mpm {
namespace {

constexpr double kLayer = 0.01;

Body box(int x, int y, int z) {
  Body body;
  body.lattice = {Vec3d(0.3, 0.1, -0.2), Quatd(Eigen::AngleAxisd(0.4, Vec3d::UnitY())), kLayer,
                  true};
  for (int i = 0; i < x; ++i)
    for (int j = 0; j < y; ++j)
      for (int k = 0; k < z; ++k) {
        body.rest.push_back(body.lattice.origin +
                            body.lattice.axes * (kLayer * Vec3d(i + 0.5, j + 0.5, k + 0.5)));
      }
  return body;
}

TEST(GridAlignment, FacesAWholeNumberOfCellsApart) {
  const auto aligned = aligned_axes(box(4, 5, 6), 2.0 * kLayer);
  EXPECT_TRUE(aligned[0]);
  EXPECT_FALSE(aligned[1]);
  EXPECT_TRUE(aligned[2]);
}

TEST(GridAlignment, APlaneThatIsHeldIsWhereTheGridBegins) {
  Body body = box(5, 5, 5);
  Pin pin;
  pin.region = Pin::Region::kPlane;
  pin.normal = body.lattice.axes * Vec3d(0.0, -2.0, 0.0);
  body.pins.push_back(pin);
  const auto aligned = aligned_axes(body, 2.0 * kLayer);
  EXPECT_FALSE(aligned[0]);
  EXPECT_TRUE(aligned[1]);
  EXPECT_FALSE(aligned[2]);
}

/// A round body touches the boundaries of cells with a few particles: where it does is chance.
TEST(GridAlignment, ARoundBodyFitsNowhere) {
  Body body = box(8, 8, 8);
  const Vec3d center = body.lattice.origin + body.lattice.axes * Vec3d::Constant(4.0 * kLayer);
  std::erase_if(body.rest, [&](const Vec3d& x) { return (x - center).norm() > 4.0 * kLayer; });
  for (const bool fits : aligned_axes(body, 2.0 * kLayer)) EXPECT_FALSE(fits);
}

}  // namespace
}  // namespace matterfit::mpm
