// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/student.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace matterfit::fit {
namespace {

TEST(Student, QuantilesOfTheTables) {
  const double table[][2] = {{1, 12.7062047}, {2, 4.3026527},   {3, 3.1824463},
                             {4, 2.7764451},  {5, 2.5705818},   {10, 2.2281389},
                             {30, 2.0422725}, {100, 1.9839715}, {1000, 1.9623391}};
  for (const auto& [freedom, quantile] : table) {
    EXPECT_NEAR(student_quantile(freedom), quantile, 2e-7) << freedom;
  }
  EXPECT_NEAR(student_quantile(9.99e5), kNormalQuantile, 1e-5);
  EXPECT_EQ(student_quantile(std::numeric_limits<double>::infinity()), kNormalQuantile);
}

TEST(Student, FallsBetweenWholeDegrees) {
  double before = 13.0;
  for (double freedom = 1.0; freedom < 200.0; freedom *= 1.07) {
    const double quantile = student_quantile(freedom);
    EXPECT_LT(quantile, before) << freedom;
    before = quantile;
  }
}

}  // namespace
}  // namespace matterfit::fit
