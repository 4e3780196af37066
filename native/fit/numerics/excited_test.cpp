// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/excited.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/message_for_test.hpp"

namespace matterfit::fit {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

/// One without a prior, and three with priors of ±.5.
std::vector<Parameter> parameters() {
  std::vector<Parameter> result(4);
  for (std::size_t k = 0; k < result.size(); ++k) {
    result[k].name = std::string(1, char('a' + k));
    result[k].low = -1.0;
    result[k].high = 1.0;
    if (k > 0) result[k].prior = Prior{0.0, 0.5};
  }
  return result;
}

TEST(Excited, AreThoseThatTheDataKnowBetterThanThePriors) {
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Identity(4, 4);
  jacobian(1, 1) = 10.0;
  jacobian(2, 2) = 2.1;  // 1/√(2.1² + 4) is less than .5/√2
  jacobian(3, 3) = 1.9;
  EXPECT_THAT(excited(parameters(), jacobian, 1), ElementsAre(1, 2));
  EXPECT_THAT(excited(parameters(), Eigen::MatrixXd::Zero(4, 4), 1), IsEmpty());
}

TEST(Excited, OfTwoThatActAlikeOneIsKept) {
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(3, 4);
  jacobian.row(0) << 0.0, 10.0, 8.0, 0.0;
  jacobian.row(1) << 1.0, 0.0, 0.0, 0.0;
  EXPECT_THAT(excited(parameters(), jacobian, 1), ElementsAre(1));
  // What the parameter before them does as well is not excited.
  jacobian.row(0) << 10.0, 10.0, 0.0, 0.0;
  jacobian.row(1).setZero();
  EXPECT_THAT(excited(parameters(), jacobian, 1), IsEmpty());
}

TEST(Excited, NeedsPriorsAndAColumnEach) {
  std::vector<Parameter> some = parameters();
  EXPECT_THAT(message_of([&] { (void)excited(some, Eigen::MatrixXd::Zero(3, 2), 1); }),
              testing::HasSubstr("a column of the Jacobian"));
  some[2].prior.reset();
  EXPECT_THAT(message_of([&] { (void)excited(some, Eigen::MatrixXd::Zero(3, 4), 1); }),
              testing::HasSubstr("priors"));
}

}  // namespace
}  // namespace matterfit::fit
