// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/members.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "diagnose/diagnose.hpp"
#include "diagnose/models_for_test.hpp"
#include "diagnose/spread.hpp"

namespace matterfit::diagnose {
namespace {

/// A beam that was let go: seven periods in the used frames. A coarser grid makes it softer, by
/// more than a radian at the end.
class VibratingModel : public HiddenModel {
 public:
  explicit VibratingModel(double softening) : softening_(softening) {
    Capture capture;
    capture.name = "release";
    for (int f = 0; f < 150; ++f) capture.times.push_back(f / 100.0);
    for (int i = 0; i < 4; ++i) capture.rest.emplace_back(0.03 * (i + 1), 0.0, 0.0);
    capture.use.assign(std::size_t(capture.samples()), Use::kUsed);
    const std::size_t later = 100 * capture.rest.size();
    for (std::size_t s = later; s < capture.use.size(); ++s) capture.use[s] = Use::kHeldOut;
    capture.noise = 2e-4;
    captures_ = {std::move(capture)};
    parameters_ = {parameter("stiffness", 1.0, 0.2, 0.01, 100.0, fit::Coordinate::kLog),
                   parameter("load", 1.0, 0.2, 0.01, 100.0, fit::Coordinate::kLog)};
    effects_ = {effect("damping", "material", {number("rate", "1/s", 0.2, true)}),
                effect("creep", "material", {number("rate", "m/s", 1e-3)})};
  }
  bool has_numerics() const override { return true; }

 protected:
  Motion truth(const Point& point) const override { return motion(point); }
  Motion motion(const Point& point) const override {
    const Numerics& grid = point.numerics;
    const double stiffness =
        std::exp(point.theta[0]) *
        (1.0 - softening_ * (grid.spacing - 1.0) + 0.1 * softening_ * (grid.offset.x() - 0.5));
    const double load = std::exp(point.theta[1]);
    double damping = 0.0;
    double creep = 0.0;
    for (const Point::Cause& cause : point.causes) {
      if (cause.effect == 0) damping = cause.values[0];
      if (cause.effect == 1) creep = cause.values[0];
    }
    const double omega = 2.0 * std::numbers::pi * 7.0 * std::sqrt(stiffness);
    Motion result{Eigen::VectorXd::Zero(3 * captures_[0].samples()), {}};
    Eigen::Index row = 0;
    for (const double t : captures_[0].times) {
      for (const Vec3d& x : captures_[0].rest) {
        const double sag = 0.006 * load / stiffness * std::pow(x.x() / 0.12, 2.0);
        const double z = sag * (std::exp(-damping * t) * std::cos(omega * t) - 1.0) + creep * t;
        result.positions.segment<3>(row) = x + Vec3d(0.0, 0.0, z);
        row += 3;
      }
    }
    return result;
  }

 private:
  double softening_;
};

double left_of(double softening) {
  VibratingModel model(softening);
  model.record({}, {});
  const Study study(model, 12000);
  const State state = study.fitted();
  const Linearised slopes = linearise(study, state, {}, {});
  const Spread spread = numerical_spread(study, state, slopes.theta, {.directions = false});
  return std::sqrt(spread.members.topRows(study.used().size()).squaredNorm() /
                   double(spread.members.cols() * study.used().size()));
}

/// Deviations that are left are far below the noise of .2 mm, where nothing depends on them.
TEST(Members, AnotherFrequencyIsNoErrorOfASolverWhoseStiffnessIsFree) {
  EXPECT_LT(left_of(0.3), 1e-4);
}

/// Where slopes promise the same nothing is run for it.
TEST(Members, WhatIsLinearIsLeftToTheCovariance) {
  VibratingModel model(1e-4);
  model.record({}, {});
  const Study study(model, 12000);
  const State state = study.fitted();
  const Linearised slopes = linearise(study, state, {}, {});
  const int before = study.runs();
  (void)numerical_spread(study, state, slopes.theta, {.directions = false});
  EXPECT_EQ(study.runs() - before, 3 + 24);
}

TEST(Members, DampingIsFoundBesideAGridThatChangesTheFrequency) {
  VibratingModel model(0.3);
  model.record({{model.effect_index("damping"), 0, Eigen::VectorXd::Constant(1, 1.0)}}, {});
  const Report report = diagnose(model);
  ASSERT_EQ(report.verdict, Verdict::kCause) << report.headline;
  EXPECT_EQ(report.causes.front().effect, "damping");
  EXPECT_NEAR(report.causes.front().parameters.front().value, 1.0, 0.15);
}

}  // namespace
}  // namespace matterfit::diagnose
