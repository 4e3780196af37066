// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/nearest.hpp"

#include <gtest/gtest.h>

namespace matterfit::fit {
namespace {

Eigen::VectorXd at(double value) { return Eigen::VectorXd::Constant(1, value); }

TEST(FitNearest, GoesAlongWithWhatComesNearer) {
  std::optional<Nearest> nearest;
  EXPECT_FALSE(leads_astray(nearest, 10.0, at(1.0)));
  EXPECT_FALSE(leads_astray(nearest, 8.0, at(2.0)));
  EXPECT_EQ(nearest->cost, 8.0);
  EXPECT_EQ(nearest->point, at(2.0));
}

TEST(FitNearest, EndsWhereTwoBeginFartherOff) {
  std::optional<Nearest> nearest;
  EXPECT_FALSE(leads_astray(nearest, 8.0, at(1.0)));
  EXPECT_FALSE(leads_astray(nearest, 9.0, at(2.0)));
  EXPECT_TRUE(leads_astray(nearest, 8.5, at(3.0)));
  EXPECT_EQ(nearest->point, at(1.0));
}

TEST(FitNearest, ARoundingFartherOffIsNone) {
  std::optional<Nearest> nearest;
  for (int k = 0; k < 5; ++k) EXPECT_FALSE(leads_astray(nearest, 8.0 + 1e-3 * k, at(k)));
}

TEST(FitNearest, WhatComesNearerAfterAllBeginsAnew) {
  std::optional<Nearest> nearest;
  EXPECT_FALSE(leads_astray(nearest, 8.0, at(1.0)));
  EXPECT_FALSE(leads_astray(nearest, 9.0, at(2.0)));
  EXPECT_FALSE(leads_astray(nearest, 7.0, at(3.0)));
  EXPECT_FALSE(leads_astray(nearest, 9.0, at(4.0)));
}

}  // namespace
}  // namespace matterfit::fit
