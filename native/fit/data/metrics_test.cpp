// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/metrics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

Points random_cloud(std::size_t count, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  Points points(count);
  for (Vec3d& x : points) x = Vec3d(uniform(engine), uniform(engine), uniform(engine));
  return points;
}

TEST(Chamfer, MatchesTheDefinition) {
  const Points a = random_cloud(60, 1);
  const Points b = random_cloud(45, 2);
  const auto one_way = [](const Points& from, const Points& to) {
    double sum = 0.0;
    for (const Vec3d& x : from) {
      double nearest = 1e9;
      for (const Vec3d& y : to) nearest = std::min(nearest, (x - y).squaredNorm());
      sum += nearest;
    }
    return sum / double(from.size());
  };
  Arena arena(2);
  EXPECT_NEAR(chamfer(a, b, arena), one_way(a, b) + one_way(b, a), 1e-14);
}

TEST(Chamfer, SameForAnyThreads) {
  const Points a = random_cloud(20000, 3);
  const Points b = random_cloud(15000, 4);
  Arena one(1);
  Arena two(2);
  EXPECT_EQ(chamfer(a, b, one), chamfer(a, b, two));
}

TEST(Chamfer, RefusesAnEmptySet) {
  Arena arena(1);
  EXPECT_THROW((void)chamfer({}, random_cloud(3, 1), arena), Error);
}

TEST(EarthMover, EqualsTheBestOfAllPermutations) {
  const Interrupter interrupter;
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Points a = random_cloud(7, 100 + seed);
    const Points b = random_cloud(7, 200 + seed);
    std::vector<std::size_t> order(7);
    std::iota(order.begin(), order.end(), 0U);
    double best = 1e9;
    do {
      double sum = 0.0;
      for (std::size_t i = 0; i < 7; ++i) sum += (a[i] - b[order[i]]).norm();
      best = std::min(best, sum / 7.0);
    } while (std::next_permutation(order.begin(), order.end()));
    EXPECT_NEAR(earth_mover(a, b, interrupter), best, 1e-12);
  }
}

TEST(EarthMover, OfATranslationIsItsLength) {
  // Moving every point by the same small vector is the optimal plan.
  const Interrupter interrupter;
  const Points a = random_cloud(500, 5);
  Points b = a;
  for (Vec3d& x : b) x += Vec3d(1e-4, 2e-4, 2e-4);
  std::reverse(b.begin(), b.end());
  EXPECT_NEAR(earth_mover(a, b, interrupter), 3e-4, 1e-12);
}

TEST(EarthMover, TiesOnALatticeEnd) {
  const Interrupter interrupter;
  Points a;
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j < 5; ++j) {
      for (int k = 0; k < 5; ++k) a.emplace_back(i, j, k);
    }
  }
  Points b = a;
  for (Vec3d& x : b) x.x() += 1.0;
  EXPECT_NEAR(earth_mover(a, b, interrupter), 1.0, 1e-12);
}

TEST(EarthMover, IsCancelled) {
  Interrupter interrupter;
  interrupter.cancel();
  const Points a = random_cloud(50, 6);
  EXPECT_THROW((void)earth_mover(a, random_cloud(50, 7), interrupter), Error);
}

TEST(Draw, IsAscendingDistinctAndSeeded) {
  const auto first = draw(1000, 100, 7);
  ASSERT_EQ(first.size(), 100U);
  EXPECT_TRUE(std::is_sorted(first.begin(), first.end()));
  EXPECT_EQ(std::adjacent_find(first.begin(), first.end()), first.end());
  EXPECT_LT(first.back(), 1000U);
  EXPECT_EQ(first, draw(1000, 100, 7));
  EXPECT_NE(first, draw(1000, 100, 8));
  EXPECT_EQ(draw(5, 9, 1).size(), 5U);
}

TEST(Draw, IsUniform) {
  std::vector<int> hits(20, 0);
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    for (const std::size_t i : draw(20, 5, seed)) ++hits[i];
  }
  // Binomial(4000, ¼): standard deviation 27.
  for (const int count : hits) EXPECT_NEAR(count, 1000, 150);
}

TEST(Quantile, IsNumpys) {
  EXPECT_DOUBLE_EQ(quantile({4, 1, 3, 2}, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(quantile({1, 2, 3, 4, 5, 6, 7, 8, 9, 10}, 0.95), 9.55);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
}

TEST(BodySize, IsTheLongestSide) {
  EXPECT_DOUBLE_EQ(body_size(Points{Vec3d(0, 0, 0), Vec3d(1, -3, 2)}), 3.0);
}

}  // namespace
}  // namespace matterfit::fit
