// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "diagnose/accept.hpp"
#include "diagnose/diagnose.hpp"
#include "diagnose/models_for_test.hpp"
#include "diagnose/trials.hpp"

namespace matterfit::diagnose {
namespace {

/// Two recordings of a beam that is let go and rings about where its weight bends it to, of which
/// the second may have a mass at its end. In the world the clamp gives under that mass, which the
/// simulator knows nothing of.
class TwoBeams : public HiddenModel {
 public:
  TwoBeams() {
    for (const char* name : {"bare", "loaded"}) {
      Capture capture;
      capture.name = name;
      for (int f = 0; f < 120; ++f) capture.times.push_back(f / 100.0);
      for (int i = 0; i < 3; ++i) capture.rest.emplace_back(0.03 * (i + 1), 0.0, 0.0);
      capture.use.assign(std::size_t(capture.samples()), Use::kUsed);
      for (std::size_t s = 270; s < 360; ++s) capture.use[s] = Use::kHeldOut;
      capture.noise = 2e-5;
      captures_.push_back(std::move(capture));
    }
    parameters_ = {parameter("stiffness", 65.0, 0.2, 1.0, 1e4, fit::Coordinate::kLog)};
    effects_ = {effect("mass", "state", {number("mass", "kg", 0.005, true)}),
                effect("drag", "outside", {number("rate", "1/s", 0.5, true)}),
                effect("frame_rate", "measurement", {number("factor", "", 0.01)}),
                effect("weight", "outside", {number("added", "", 0.05)})};
    effects_[0].scope = "capture loaded";
    effects_[0].far_tries = {0.015, 0.03, 0.06};
  }

 protected:
  Motion motion(const Point& point) const override { return move(point, 0.0); }
  Motion truth(const Point& point) const override { return move(point, 0.04); }

 private:
  Motion move(const Point& point, double clamp) const {
    double mass = 0.0;
    double rate = 2.0;
    double clock = 1.0;
    double weight = 9.81;
    for (const Point::Cause& cause : point.causes) {
      if (cause.effect == 0) mass = cause.values[0];
      if (cause.effect == 1) rate += cause.values[0];
      if (cause.effect == 2) clock += cause.values[0];
      if (cause.effect == 3) weight *= 1.0 + cause.values[0];
    }
    const double fitted = fit::from_natural(parameters_[0].coordinate, point.theta[0]);
    Motion result{Eigen::VectorXd::Zero(3 * (captures_[0].samples() + captures_[1].samples())), {}};
    Eigen::Index row = 0;
    for (std::size_t c = 0; c < captures_.size(); ++c) {
      const double load = c == 1 ? mass : 0.0;
      const double stiffness = c == 1 ? fitted : (1.0 - 2.0 * clamp) * fitted;
      const double omega = std::sqrt(stiffness / (0.024 + load));
      const double sag = (0.0375 + load) * weight / stiffness;
      for (const double now : captures_[c].times) {
        const double t = std::max(0.0, now * clock - 0.1);
        const double gives = load > 0.0 ? clamp * (1.0 - std::exp(-t / 0.2)) : 0.0;
        const double swing = sag * (1.0 + gives - std::exp(-rate * t) * std::cos(omega * t));
        for (const Vec3d& x : captures_[c].rest) {
          result.positions.segment<3>(row) =
              x - Vec3d(0.0, 0.0, swing * std::pow(x.x() / 0.1, 2.0));
          row += 3;
        }
      }
    }
    return result;
  }
};

/// Even the right model leaves more than noise, and the bare recording says nothing of the mass.
TEST(Rivals, OfAMassInOneOfTwoRecordingsThereAreNone) {
  TwoBeams model;
  model.record({{0, 0, Eigen::VectorXd::Constant(1, 0.052)}}, {.sigma = 2e-5});
  DiagnoseOptions options;
  options.most_causes = 1;
  const Report report = diagnose(model, options);
  EXPECT_EQ(report.verdict, Verdict::kCause) << report.headline;
  ASSERT_FALSE(report.causes.empty());
  EXPECT_EQ(report.causes.front().effect, "mass");
  EXPECT_NEAR(report.causes.front().parameters.front().value, 0.052, 0.008);
  EXPECT_TRUE(report.remains);
}

/// Air that moves across a throw and against it does nearly what drag and a tilt do together, but
/// no air moves without drag.
TEST(Rivals, WindIsNamedBesideDragAlone) {
  for (const char* other : {"gravity_direction", "wind"}) {
    ThrownModel model({Vec3d(3.0, 1.0, 2.0)});
    model.add_wind();
    Eigen::VectorXd sideways = Vec3d(1.0, 4.0, 0.0);
    if (other == std::string("gravity_direction")) sideways = Eigen::Vector2d(0.01, -0.015);
    model.record({{model.effect_index("drag_quadratic"), 0, Eigen::VectorXd::Constant(1, 0.04)},
                  {model.effect_index(other), 0, sideways}},
                 {});
    const Report report = diagnose(model);
    EXPECT_EQ(report.verdict, Verdict::kSeveral) << report.headline;
    EXPECT_THAT(report.classes, testing::UnorderedElementsAre("drag_quadratic", other))
        << report.headline;
  }
}

Trial trial_of(double chi_square, double gain) {
  Trial trial;
  trial.refit.chi_square = chi_square;
  trial.refit.freedom = 100.0;
  trial.gain.value = gain;
  trial.gain.measurable = true;
  return trial;
}

TEST(Rivals, ExplainOrPredictAtLeastHalfAsWell) {
  const Trial base = trial_of(10100.0, 0.0);
  const Trial good = trial_of(2100.0, 0.7);  // takes 8000 of the 10 000 beyond its freedom
  EXPECT_TRUE(falls_short(base, good, trial_of(7100.0, 0.1)));
  EXPECT_FALSE(falls_short(base, good, trial_of(7100.0, 0.6)));
  EXPECT_FALSE(falls_short(base, good, trial_of(2200.0, 0.1)));
  Trial untested = trial_of(7100.0, 0.0);
  untested.gain.measurable = false;
  EXPECT_FALSE(falls_short(base, good, untested));
}

/// A forecast must be as good as that of a free field of accelerations, unless what it leaves is
/// what noise and the solver make.
TEST(Rivals, AForecastIsAsGoodAsTheFreeFieldsOrWithinTheFloor) {
  Judge::Opinion opinion;
  Gain gain{.before = 17e-3,
            .after = .94e-3,
            .floor = 2.8e-3,
            .value = 1.0,
            .low = 1.0,
            .high = 1.0,
            .last_residual = 9.8e-3,
            .free_field = .9e-3,
            .measurable = true};
  EXPECT_TRUE(predicts(gain, opinion, opinion, 1));
  gain.floor = .5e-3;
  EXPECT_FALSE(predicts(gain, opinion, opinion, 1));
  gain.free_field = .95e-3;
  EXPECT_TRUE(predicts(gain, opinion, opinion, 1));
  gain.floor = 17e-3;
  gain.last_residual = .9e-3;
  EXPECT_FALSE(predicts(gain, opinion, opinion, 1));
}

/// Those that are excluded stay behind, whatever they cost.
TEST(Rivals, TheSimplestOfThoseThatAreAlikeComesFirst) {
  std::vector<Trial> trials(4);
  const double evidences[] = {100.0, 103.0, 104.5, 109.5};
  const int numbers[] = {9, 6, 9, 0};
  for (std::size_t k = 0; k < trials.size(); ++k) {
    trials[k].evidence = evidences[k];
    trials[k].numbers = numbers[k];
    trials[k].refit.chi_square = 1.0;
  }
  put_simplest_first(trials);
  EXPECT_EQ(trials[0].evidence, 103.0);
  EXPECT_EQ(trials[1].evidence, 100.0);
  EXPECT_EQ(trials[3].evidence, 109.5);
}

}  // namespace
}  // namespace matterfit::diagnose
