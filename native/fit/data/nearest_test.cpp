// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/nearest.hpp"

#include <gtest/gtest.h>

#include <random>

namespace matterfit::fit {
namespace {

TEST(Nearest, IsThatOfAllPairs) {
  std::mt19937 engine(1);
  std::normal_distribution<double> normal(0.0, 1.0);
  const auto draw = [&](std::size_t count) {
    Points points(count);
    for (Vec3d& x : points) x = Vec3d(normal(engine), normal(engine), normal(engine));
    return points;
  };
  const Points from = draw(700);
  const Points to = draw(300);
  Arena arena(2);
  const auto found = nearest(from, to, arena);
  ASSERT_EQ(found.size(), from.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    std::size_t best = 0;
    for (std::size_t j = 1; j < to.size(); ++j) {
      if ((from[i] - to[j]).squaredNorm() < (from[i] - to[best]).squaredNorm()) best = j;
    }
    EXPECT_EQ(found[i].index, best);
    EXPECT_DOUBLE_EQ(found[i].squared, (from[i] - to[best]).squaredNorm());
  }
}

}  // namespace
}  // namespace matterfit::fit
