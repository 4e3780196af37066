// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/initial_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

constexpr double kUnseen = std::numeric_limits<double>::quiet_NaN();

struct Throw {
  Vec3d center{0.3, -0.2, 1.5};
  Vec3d gravity{0, 0, -9.81};
  Vec3d velocity{1.2, -0.7, 2.5};
  Vec3d spin{3.0, -5.0, 4.0};
  Vec3d offset = Vec3d::Zero();
  Vec3d rotation = Vec3d::Zero();
  double first = 0.0;
  double spacing = 1.0 / 60.0;
  std::size_t frames = 12;
  double noise = 0.0;
  unsigned seed = 1;

  [[nodiscard]] std::vector<double> times() const {
    std::vector<double> result;
    for (std::size_t i = 0; i < frames; ++i) result.push_back(first + double(i) * spacing);
    return result;
  }
  [[nodiscard]] Points positions(const Points& rest) const {
    std::mt19937 engine(seed);
    std::normal_distribution<double> normal(0.0, 1.0);
    const auto turn = [](const Vec3d& v) {
      return Mat3d(Eigen::AngleAxisd(v.norm(), v.normalized()));
    };
    Points result;
    for (const double t : times()) {
      const Mat3d start = rotation.isZero() ? Mat3d(Mat3d::Identity()) : turn(rotation);
      const Mat3d spun = t == 0.0 || spin.isZero() ? Mat3d(Mat3d::Identity()) : turn(t * spin);
      for (const Vec3d& x : rest) {
        Vec3d y =
            center + offset + t * velocity + 0.5 * t * t * gravity + spun * (start * (x - center));
        for (int k = 0; k < 3; ++k) y[k] += noise * normal(engine);
        result.push_back(y);
      }
    }
    return result;
  }
  [[nodiscard]] InitialMotion found(const Points& rest, const Points& at) const {
    return initial_motion(rest, center, times(), at, gravity);
  }
  [[nodiscard]] InitialMotion found(const Points& rest) const {
    return found(rest, positions(rest));
  }
};

/// Points of a body of 20 × 12 × 6 cm about `center`.
Points body(const Vec3d& center, std::size_t count) {
  std::mt19937 engine(7);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  Points points(count);
  const Vec3d size(0.2, 0.12, 0.06);
  for (Vec3d& x : points) {
    for (int k = 0; k < 3; ++k) x[k] = center[k] + size[k] * uniform(engine);
  }
  return points;
}

Points bar(const Vec3d& center, const Vec3d& direction) {
  Points points;
  for (const double s : {-0.1, -0.03, 0.02, 0.08}) points.push_back(center + s * direction);
  return points;
}

void expect_exact(const Throw& thrown, const InitialMotion& found, double tolerance = 1e-11) {
  EXPECT_LT((found.velocity - thrown.velocity).norm(), tolerance);
  EXPECT_LT((found.spin - thrown.spin).norm(), tolerance * 100.0);
  EXPECT_LT((found.offset - thrown.offset).norm(), tolerance);
  EXPECT_LT((found.rotation - thrown.rotation).norm(), tolerance * 10.0);
  EXPECT_LT(found.residual, 1e-13);
  EXPECT_TRUE(found.spin_observable);
}

TEST(InitialMotion, OfAThrownSpinningBodyIsExact) {
  const Throw thrown;
  expect_exact(thrown, thrown.found(body(thrown.center, 20)));
}

TEST(InitialMotion, OfABodyAtRestIsNone) {
  Throw thrown;
  thrown.velocity = thrown.spin = thrown.gravity = Vec3d::Zero();
  expect_exact(thrown, thrown.found(body(thrown.center, 20)));
}

TEST(InitialMotion, FindsWhereTheFirstFrameLies) {
  Throw thrown;
  thrown.offset = Vec3d(0.02, 0.01, -0.03);
  thrown.rotation = Vec3d(0.4, -0.8, 1.1);  // not about the axis of the spin
  expect_exact(thrown, thrown.found(body(thrown.center, 20)));
}

TEST(InitialMotion, IsThatAtTimeZero) {
  Throw thrown;
  thrown.first = 0.4;
  thrown.offset = Vec3d(0.02, 0.01, -0.03);
  thrown.rotation = Vec3d(0.4, -0.8, 1.1);
  expect_exact(thrown, thrown.found(body(thrown.center, 20)), 1e-10);
}

TEST(InitialMotion, CountsWholeTurns) {
  Throw thrown;
  thrown.spin = Vec3d(0.0, 90.0, 30.0);  // a turn in four frames, 15 turns in all
  thrown.frames = 60;
  expect_exact(thrown, thrown.found(body(thrown.center, 20)), 1e-10);
}

TEST(InitialMotion, OfManyTurnsWithNoiseIsThatOfLeastSquares) {
  Throw thrown;
  thrown.spin = Vec3d(0.0, 90.0, 30.0);
  thrown.frames = 60;
  thrown.noise = 3e-3;
  constexpr unsigned kDraws = 8;
  double rate = 0.0;  // squares of errors
  double axis = 0.0;
  for (thrown.seed = 1; thrown.seed <= kDraws; ++thrown.seed) {
    const InitialMotion found = thrown.found(body(thrown.center, 20));
    EXPECT_NEAR(found.residual, 3e-3 * std::sqrt(3.0), 0.2e-3);
    rate += std::pow(found.spin.norm() - thrown.spin.norm(), 2) / kDraws;
    axis += (found.spin.cross(thrown.spin) / thrown.spin.squaredNorm()).squaredNorm() / kDraws;
  }
  // One frame's angle is known to about 0.013 rad: the rate of a line through 60 of them to 0.006
  // rad/s, the axis, against which an error does not grow, to about 0.013/√60 rad each way.
  EXPECT_LT(std::sqrt(rate), 0.009);
  EXPECT_LT(std::sqrt(axis), 0.0036);
}

TEST(InitialMotion, NeedsNoMoreThanTwoFrames) {
  Throw thrown;
  thrown.frames = 2;
  expect_exact(thrown, thrown.found(body(thrown.center, 3)), 1e-10);
}

TEST(InitialMotion, SkipsSamplesThatAreNotThere) {
  const Throw thrown;
  const Points rest = body(thrown.center, 6);
  Points seen = thrown.positions(rest);
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::size_t missing = 0;
  for (Vec3d& x : seen) {
    if (uniform(engine) > 0.5) continue;
    x.y() = kUnseen;
    ++missing;
  }
  ASSERT_GT(missing, 20U);
  expect_exact(thrown, thrown.found(rest, seen));
}

TEST(InitialMotion, UsesFramesWithFewPoints) {
  // Never three points in a frame: no frame is placed by itself.
  Throw thrown;
  thrown.spin = Vec3d(1.2, -0.8, 0.9);
  thrown.frames = 60;
  const Points rest = body(thrown.center, 6);
  Points seen = thrown.positions(rest);
  for (std::size_t frame = 0; frame < thrown.frames; ++frame) {
    for (std::size_t point = 0; point < 6; ++point) {
      if (point % 3 != frame % 3) seen[frame * 6 + point].x() = kUnseen;
    }
  }
  expect_exact(thrown, thrown.found(rest, seen));
}

TEST(InitialMotion, StandsNoise) {
  // Against the scatter of many repetitions: unbiased, and the residual is the noise.
  Throw thrown;
  thrown.noise = 1e-3;
  thrown.rotation = Vec3d(0.1, 0.2, -0.1);
  const Points rest = body(thrown.center, 20);
  Vec3d velocity = Vec3d::Zero();
  Vec3d spin = Vec3d::Zero();
  double square = 0.0;
  double spin_square = 0.0;
  const int repetitions = 200;
  for (int i = 0; i < repetitions; ++i) {
    thrown.seed = unsigned(100 + i);
    const InitialMotion found = thrown.found(rest);
    velocity += (found.velocity - thrown.velocity) / repetitions;
    spin += (found.spin - thrown.spin) / repetitions;
    square += (found.velocity - thrown.velocity).squaredNorm() / repetitions;
    spin_square += (found.spin - thrown.spin).squaredNorm() / repetitions;
    EXPECT_NEAR(found.residual, 1e-3 * std::sqrt(3.0), 0.15e-3);
  }
  // A straight line through 12 frames of 20 points: variance σ² / (20 Σ (t − mean)²) a component,
  // known at the middle and the same at time 0, as gravity is known.
  const double expected = 3.0 * 1e-6 / (20.0 * 143.0 / 3600.0);
  EXPECT_NEAR(square / expected, 1.0, 0.2);
  EXPECT_LT(velocity.norm(), 3.0 * std::sqrt(expected / repetitions));
  EXPECT_LT(spin.norm(), 3.0 * std::sqrt(spin_square / repetitions));
  // About 6 cm across: a few times the relative error of the velocity over that.
  EXPECT_LT(std::sqrt(spin_square), 0.25);
}

TEST(InitialMotion, OfABarHasNoSpinAboutIt) {
  Throw thrown;
  thrown.rotation = Vec3d::Zero();
  const Vec3d direction = Vec3d(1, 2, 2) / 3.0;
  thrown.spin = 6.0 * direction.unitOrthogonal();
  const Points rest = bar(thrown.center, direction);
  const InitialMotion found = thrown.found(rest);
  EXPECT_FALSE(found.spin_observable);
  EXPECT_LT((found.spin - thrown.spin).norm(), 1e-9);
  EXPECT_LT((found.velocity - thrown.velocity).norm(), 1e-10);
  EXPECT_LT(found.rotation.norm(), 1e-10);
  EXPECT_LT(found.residual, 1e-13);
  // A spin about the bar itself cannot be seen.
  thrown.spin = 6.0 * direction;
  const InitialMotion hidden = thrown.found(rest);
  EXPECT_FALSE(hidden.spin_observable);
  EXPECT_LT(hidden.spin.norm(), 1e-9);
  EXPECT_LT((hidden.velocity - thrown.velocity).norm(), 1e-10);
}

TEST(InitialMotion, OfABarWithNoiseDoesNotRunAway) {
  Throw thrown;
  const Vec3d direction = Vec3d(1, 2, 2) / 3.0;
  thrown.spin = 6.0 * direction.unitOrthogonal();
  thrown.noise = 1e-3;
  Points rest = bar(thrown.center, direction);
  const Points seen = thrown.positions(rest);
  const auto turned = [](const Vec3d& v, const Vec3d& x) {
    return Vec3d(Eigen::AngleAxisd(v.norm(), v.normalized()) * x);
  };
  const InitialMotion straight = thrown.found(rest, seen);
  const double middle = 0.5 * thrown.times().back();
  const Vec3d along = turned(middle * straight.spin, turned(straight.rotation, direction));
  EXPECT_LT(std::abs(along.dot(straight.spin)), 1e-9);
  // Measured rest positions do not lie on the line exactly.
  std::mt19937 engine(5);
  std::normal_distribution<double> normal(0.0, 1e-3);
  for (Vec3d& x : rest) x += Vec3d(normal(engine), normal(engine), normal(engine));
  const InitialMotion found = thrown.found(rest, seen);
  EXPECT_FALSE(found.spin_observable);
  EXPECT_LT((found.spin - thrown.spin).norm(), 0.5);
  EXPECT_LT((found.velocity - thrown.velocity).norm(), 0.03);
}

TEST(InitialMotion, OfOnePointHasNoSpin) {
  const Throw thrown;
  const Points rest{thrown.center};
  const InitialMotion found = thrown.found(rest);
  EXPECT_FALSE(found.spin_observable);
  EXPECT_EQ(found.spin, Vec3d(0, 0, 0));
  EXPECT_LT((found.velocity - thrown.velocity).norm(), 1e-11);
  EXPECT_LT(found.residual, 1e-13);
}

TEST(InitialMotion, RefusesWhatIsTooLittle) {
  const Throw thrown;
  const Points rest = body(thrown.center, 4);
  const Points seen = thrown.positions(rest);
  const auto refused = [&](std::vector<double> times, Points positions) {
    try {
      (void)initial_motion(rest, thrown.center, times, positions, thrown.gravity);
    } catch (const Error& error) {
      return error.kind() == ErrorKind::kInput;
    }
    return false;
  };
  EXPECT_TRUE(refused({0.0}, Points(seen.begin(), seen.begin() + 4)));
  EXPECT_TRUE(refused({0.0, 0.1}, seen));
  EXPECT_TRUE(refused({0.1, 0.1}, Points(seen.begin(), seen.begin() + 8)));
  EXPECT_TRUE(refused({0.0, kUnseen}, Points(seen.begin(), seen.begin() + 8)));
  Points once(8, Vec3d::Constant(kUnseen));
  once[0] = once[5] = Vec3d::Zero();  // two points, each seen once
  EXPECT_TRUE(refused({0.0, 0.1}, once));
  once[4] = Vec3d::Ones();
  EXPECT_FALSE(refused({0.0, 0.1}, once));
}

}  // namespace
}  // namespace matterfit::fit
