// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/bounded_step.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>
#include <random>

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kUnbounded = std::numeric_limits<double>::infinity();

struct Quadratic {
  MatrixXd a;
  VectorXd g;
};

Quadratic random_quadratic(Index n, std::mt19937& engine) {
  std::normal_distribution<double> normal(0.0, 1.0);
  const MatrixXd root = MatrixXd::NullaryExpr(n, n, [&] { return normal(engine); });
  Quadratic q;
  q.a = root * root.transpose() + 1e-3 * MatrixXd::Identity(n, n);
  q.g = VectorXd::NullaryExpr(n, [&] { return normal(engine); });
  return q;
}

/// The best of all 3ⁿ choices of which components lie at which bound.
VectorXd by_enumeration(const Quadratic& q, const Box& box) {
  const Index n = q.g.size();
  Index count = 1;
  for (Index k = 0; k < n; ++k) count *= 3;
  double least = kUnbounded;
  VectorXd best;
  for (Index choice = 0; choice < count; ++choice) {
    std::vector<Index> free;
    VectorXd s = VectorXd::Zero(n);
    for (Index k = 0, rest = choice; k < n; ++k, rest /= 3) {
      if (rest % 3 == 0) free.push_back(k);
      if (rest % 3 == 1) s[k] = box.low[k];
      if (rest % 3 == 2) s[k] = box.high[k];
    }
    if (!free.empty()) {
      const VectorXd right = (q.g + q.a * s)(free);
      const MatrixXd reduced = q.a(free, free);
      s(free) = -reduced.ldlt().solve(right);
    }
    const bool inside =
        ((s - box.low).array() >= -1e-12).all() && ((box.high - s).array() >= -1e-12).all();
    const double value = q.g.dot(s) + 0.5 * s.dot(q.a * s);
    if (inside && value < least) {
      least = value;
      best = s;
    }
  }
  return best;
}

TEST(BoundedStep, WithoutBoundsIsNewtons) {
  std::mt19937 engine(1);
  const Quadratic q = random_quadratic(5, engine);
  const Box box{VectorXd::Constant(5, -kUnbounded), VectorXd::Constant(5, kUnbounded)};
  EXPECT_LT((bounded_step(q.a, q.g, box) + q.a.ldlt().solve(q.g)).norm(), 1e-9);
}

TEST(BoundedStep, IsTheBestOfAllActiveSets) {
  std::mt19937 engine(2);
  std::uniform_real_distribution<double> uniform(0.0, 0.4);
  for (int trial = 0; trial < 200; ++trial) {
    const Quadratic q = random_quadratic(5, engine);
    Box box{VectorXd(5), VectorXd(5)};
    for (Index k = 0; k < 5; ++k) {
      // Some components start at a bound.
      box.low[k] = trial % 3 == 0 && k < 2 ? 0.0 : -uniform(engine);
      box.high[k] = trial % 4 == 0 && k > 3 ? 0.0 : uniform(engine);
    }
    EXPECT_LT((bounded_step(q.a, q.g, box) - by_enumeration(q, box)).norm(), 1e-9) << trial;
  }
}

TEST(BoundedStep, StaysWhereEveryWayIsClosed) {
  std::mt19937 engine(3);
  const Quadratic q = random_quadratic(4, engine);
  const Box box{VectorXd::Zero(4), VectorXd::Zero(4)};
  EXPECT_EQ(bounded_step(q.a, q.g, box), VectorXd(VectorXd::Zero(4)));
}

}  // namespace
}  // namespace matterfit::fit
