// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/thin.hpp"

#include <gtest/gtest.h>

#include <random>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

TEST(Thin, KeepsVolumeAndCentreOfMass) {
  std::mt19937 engine(5);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  Points positions;
  std::vector<double> volumes;
  double volume = 0.0;
  Vec3d moment = Vec3d::Zero();
  for (int i = 0; i < 4000; ++i) {
    Vec3d x;
    for (int k = 0; k < 3; ++k) x[k] = uniform(engine);
    positions.push_back(x);
    volumes.push_back(1e-3 * (0.5 + uniform(engine)));
    volume += volumes.back();
    moment += volumes.back() * x;
  }
  thin(positions, volumes, 0.2);
  EXPECT_EQ(positions.size(), 125U);
  double left = 0.0;
  Vec3d at = Vec3d::Zero();
  for (std::size_t i = 0; i < positions.size(); ++i) {
    left += volumes[i];
    at += volumes[i] * positions[i];
  }
  EXPECT_NEAR(left, volume, 1e-12);
  EXPECT_LT((at - moment).norm(), 1e-12);
}

TEST(Thin, MakesACoarserLatticeOfALattice) {
  Points positions;
  std::vector<double> volumes;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 4; ++j) positions.emplace_back(0.1 * i, 0.1 * j, 2.0);
  }
  volumes.assign(positions.size(), 1e-3);
  thin(positions, volumes, 0.2 - 1e-9);
  ASSERT_EQ(positions.size(), 6U);
  EXPECT_LT((positions.front() - Vec3d(0.05, 0.05, 2.0)).norm(), 1e-12);
  EXPECT_NEAR(volumes.front(), 4e-3, 1e-15);
}

TEST(Thin, RefusesWhatMakesNoSense) {
  Points positions(2, Vec3d::Zero());
  std::vector<double> volumes(2, 1.0);
  EXPECT_THROW(thin(positions, volumes, 0.0), Error);
  volumes.pop_back();
  EXPECT_THROW(thin(positions, volumes, 1.0), Error);
}

}  // namespace
}  // namespace matterfit::capture
