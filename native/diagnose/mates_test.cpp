// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/mates.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "diagnose/models_for_test.hpp"

namespace matterfit::diagnose {
namespace {

/// Points that swing, and lose it in proportion to their speed (`thick`) or also to where along the
/// body they are (`inner`), which is confused with that.
class SwingingModel : public HiddenModel {
 public:
  SwingingModel() {
    Capture capture;
    capture.name = "swing";
    for (int f = 0; f < 120; ++f) capture.times.push_back(f / 100.0);
    for (int i = 0; i < 4; ++i) capture.rest.emplace_back(0.03 * (i + 1), 0.0, 0.0);
    capture.use.assign(std::size_t(capture.samples()), Use::kUsed);
    capture.noise = 2e-5;
    captures_ = {std::move(capture)};
    parameters_ = {parameter("stiffness", 1.0, 0.2, 0.01, 100.0, fit::Coordinate::kLog)};
    effects_ = {effect("thick", "outside", {number("rate", "1/s", 0.5, true)}),
                effect("inner", "material", {number("rate", "1/s", 0.5, true)}),
                effect("unrelated", "outside", {number("size", "m", 1e-3)})};
    effects_[0].confused_with = {"inner"};
    effects_[1].confused_with = {"thick"};
  }

 protected:
  Motion motion(const Point& point) const override {
    const double omega = 2.0 * std::numbers::pi * 7.0 * std::exp(0.5 * point.theta[0]);
    double rates[2] = {};
    double size = 0.0;
    for (const Point::Cause& cause : point.causes) {
      if (cause.effect < 2) rates[cause.effect] += cause.values[0];
      if (cause.effect == 2) size += cause.values[0];
    }
    Motion result{Eigen::VectorXd::Zero(3 * captures_[0].samples()), {}};
    Eigen::Index row = 0;
    for (const double t : captures_[0].times) {
      for (const Vec3d& x : captures_[0].rest) {
        const double rate = rates[0] + rates[1] * (0.9 + x.x());
        const double swing = std::pow(x.x() / 0.12, 2.0) * 0.006 * std::exp(-rate * t);
        result.positions.segment<3>(row) = x + Vec3d(0.0, size * t, swing * std::cos(omega * t));
        row += 3;
      }
    }
    return result;
  }
};

TEST(Mates, AreThoseOfTheCatalogueThatWereNotTried) {
  SwingingModel model;
  std::vector<Score> scores(3);
  for (int e = 0; e < 3; ++e) {
    scores[std::size_t(e)].candidate = {e, 0};
    scores[std::size_t(e)].observable = true;
  }
  const std::vector<Candidate> mates = mates_of(model, scores, {0, 0}, {0});
  ASSERT_EQ(mates.size(), 1U);
  EXPECT_EQ(mates[0].effect, 1);
  EXPECT_TRUE(mates_of(model, scores, {0, 0}, {0, 1}).empty());
  // By a share of the cause's own score.
  scores[0].statistic = 100.0;
  scores[1].statistic = 30.0;
  EXPECT_EQ(mates_of(model, scores, {0, 0}, {0}, 0.25).size(), 1U);
  EXPECT_TRUE(mates_of(model, scores, {0, 0}, {0}, 0.5).empty());
  scores[1].observable = false;
  EXPECT_TRUE(mates_of(model, scores, {0, 0}, {0}).empty());
}

TEST(Mates, BeginWhereTheyDoWhatTheOtherDoes) {
  SwingingModel model;
  model.record({}, {});
  const Study study(model, 12000);
  Refit good;
  good.state = study.fitted();
  good.state.theta[0] = 0.3;
  good.state.causes = {{0, 0, Eigen::VectorXd::Constant(1, 2.0)}};
  good.prediction = *study.predict({good.state}).front();
  Noise noise;
  noise.captures.resize(1);
  noise.captures[0].sigma = 1e-4;
  noise.weights = Eigen::VectorXd::Ones(study.used().size());
  const Whitening whitening(study.used(), noise, Eigen::MatrixXd(study.used().size(), 0));
  const auto starts = starts_beside(study, whitening, good, {{1, 0}}, {});
  ASSERT_EQ(starts.size(), 1U);
  EXPECT_EQ(starts[0].first.effect, 1);
  const std::vector<State>& states = starts[0].second.states;
  ASSERT_EQ(states.size(), 3U);
  // By slopes at no loss at all a motion that dies away looks as if it lost less.
  const double first = states[0].causes[0].values[0];
  EXPECT_GT(first, 0.5);
  EXPECT_LT(first, 2.5);
  EXPECT_DOUBLE_EQ(states[1].causes[0].values[0], 2.0 * first);
  EXPECT_DOUBLE_EQ(states[2].causes[0].values[0], 0.5 * first);
  EXPECT_EQ(states[0].theta[0], 0.3);
}

}  // namespace
}  // namespace matterfit::diagnose
