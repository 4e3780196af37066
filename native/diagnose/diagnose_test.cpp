// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/diagnose.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "diagnose/models_for_test.hpp"

namespace matterfit::diagnose {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::StartsWith;
using testing::UnorderedElementsAre;

ThrownModel two_throws() { return ThrownModel({Vec3d(2.0, 0.5, 1.0), Vec3d(9.0, -1.0, 3.0)}); }

std::string told_by_report(const Report& report) {
  std::string text = std::string(name(report.verdict)) + " p=" + std::to_string(report.p) +
                     " smooth=" + std::to_string(report.smooth_p) +
                     " after=" + std::to_string(report.smooth_p_after) + " " + report.headline;
  for (std::size_t i = 0; i < std::min<std::size_t>(5, report.causes.size()); ++i) {
    const Cause& cause = report.causes[i];
    text += "\n  " + cause.effect + " " + cause.where + " T=" + std::to_string(cause.score) +
            " P=" + std::to_string(cause.probability) + " gain " + std::to_string(cause.gain) +
            " [" + std::to_string(cause.gain_low) + "] before " +
            std::to_string(cause.holdout_before) + " after " + std::to_string(cause.holdout_after) +
            " floor " + std::to_string(cause.holdout_floor) + " last " +
            std::to_string(cause.last_residual) + " field " + std::to_string(cause.free_field);
    for (const Value& value : cause.parameters) text += " " + with_error(value);
  }
  return text;
}

struct Hidden {
  std::string effect;
  std::vector<double> values;
};

Point::Cause cause_of(const HiddenModel& model, const Hidden& hidden, int variant = 0) {
  return {
      model.effect_index(hidden.effect), variant,
      Eigen::Map<const Eigen::VectorXd>(hidden.values.data(), Eigen::Index(hidden.values.size()))};
}

class HidesOne : public testing::TestWithParam<Hidden> {};

TEST_P(HidesOne, IsNamedWithItsSizeAndGainsOnUnseenFrames) {
  ThrownModel model = two_throws();
  model.record({cause_of(model, GetParam())}, {});
  const Report report = diagnose(model);
  ASSERT_THAT(report.classes, ElementsAre(GetParam().effect)) << told_by_report(report);
  EXPECT_EQ(report.verdict,
            report.causes[0].group == "measurement" ? Verdict::kMeasurement : Verdict::kCause);
  const Cause& cause = report.causes[0];
  EXPECT_EQ(cause.effect, GetParam().effect);
  EXPECT_TRUE(cause.accepted);
  EXPECT_GT(cause.probability, 0.9) << told_by_report(report);
  for (std::size_t k = 0; k < GetParam().values.size(); ++k) {
    EXPECT_NEAR(cause.parameters[k].value, GetParam().values[k], 4.0 * cause.parameters[k].error)
        << told_by_report(report);
  }
  if (cause.gain_measurable) {
    EXPECT_GT(cause.gain, 0.8) << told_by_report(report);
    EXPECT_LT(cause.holdout_after, cause.free_field);
    EXPECT_LT(cause.holdout_after, cause.last_residual);
  }
  EXPECT_LT(cause.holdout_after, cause.holdout_before);
  double before = 0.0;
  double after = 0.0;
  for (const FrameError& frame : report.by_frame) {
    before += frame.rms * frame.rms;
    after += frame.after * frame.after;
  }
  EXPECT_LT(after, before);
  std::size_t frames = 0;
  for (const Capture& capture : model.captures()) frames += capture.times.size();
  ASSERT_EQ(cause.evidence_by_frame.size(), frames);
  EXPECT_GT(*std::ranges::max_element(cause.evidence_by_frame), 0.0);
  EXPECT_GE(std::size_t(report.tested), report.causes.size());
  ASSERT_EQ(report.regions.size(), model.captures().size());
}

INSTANTIATE_TEST_SUITE_P(Thrown, HidesOne,
                         testing::Values(Hidden{"gravity_direction", {0.02, -0.03}},
                                         Hidden{"drag_linear", {0.1}},
                                         Hidden{"drag_quadratic", {0.03}},
                                         Hidden{"force_field", {0.5}}, Hidden{"spin", {0.3}},
                                         Hidden{"time_offset", {0.004}}, Hidden{"scale", {0.02}},
                                         Hidden{"tracker_lag", {0.01}}),
                         [](const auto& info) { return info.param.effect; });

TEST(Diagnose, GravityAndFrameRateAreOneClassInThrows) {
  // x = vt − ½gt² with v free: only g over the square of the frame rate is seen.
  for (const Hidden& hidden : {Hidden{"gravity_size", {0.05}}, Hidden{"frame_rate", {0.02}}}) {
    ThrownModel model = two_throws();
    model.record({cause_of(model, hidden)}, {});
    const Report report = diagnose(model);
    EXPECT_EQ(report.verdict, Verdict::kClass);
    EXPECT_THAT(report.classes, UnorderedElementsAre("gravity_size", "frame_rate"))
        << told_by_report(report);
    EXPECT_GT(report.causes[0].gain, 0.9);
  }
}

class FalseAlarms : public testing::TestWithParam<double> {};

TEST_P(FalseAlarms, AreRare) {
  constexpr int kSeeds = 24;
  int alarms = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    ThrownModel model = two_throws();
    TestNoise noise;
    noise.correlation = GetParam();
    noise.seed = std::uint64_t(seed);
    model.record({}, noise);
    const Report report = diagnose(model);
    alarms += report.verdict == Verdict::kNothing ? 0 : 1;
    if (seed > 1) continue;
    EXPECT_NEAR(report.noise.sigma, noise.sigma, 0.1 * noise.sigma);
    EXPECT_NEAR(report.noise.autocorrelation, noise.correlation, 0.05);
    // A drift of the camera is a velocity.
    EXPECT_THAT(report.not_observable, ElementsAre("camera_drift"));
    EXPECT_EQ(report.detection_limits.size(), 11U);
  }
  // With 5 % each, more than 4 of 24 have a probability of .6 %.
  EXPECT_LE(alarms, 4);
}

INSTANTIATE_TEST_SUITE_P(Correlation, FalseAlarms, testing::Values(0.0, 0.8));

TEST(Diagnose, SharedShakingAndOutliersAreNoise) {
  ThrownModel model = two_throws();
  TestNoise noise;
  noise.common = 1e-3;
  noise.outliers = 0.01;
  model.record({}, noise);
  const Report nothing = diagnose(model);
  EXPECT_EQ(nothing.verdict, Verdict::kNothing) << told_by_report(nothing);
  EXPECT_NEAR(nothing.noise.common_sigma, 1e-3, 3e-4);
  model.record({cause_of(model, {"drag_quadratic", {0.03}})}, noise);
  const Report drag = diagnose(model);
  EXPECT_THAT(drag.classes, ElementsAre("drag_quadratic")) << told_by_report(drag);
}

TEST(Diagnose, TwoCausesAreNamedTogether) {
  ThrownModel model = two_throws();
  model.record({cause_of(model, {"drag_quadratic", {0.03}}), cause_of(model, {"spin", {0.3}})}, {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kSeveral) << told_by_report(report);
  EXPECT_THAT(report.classes, UnorderedElementsAre("drag_quadratic", "spin"))
      << told_by_report(report);
  ASSERT_EQ(report.extended.causes.size(), 2U);
}

/// An acceleration in any direction takes the mean of a drag along, so it is found first; beside
/// the drag it does no more than a direction of gravity, which has fewer numbers.
TEST(Diagnose, TheSimplerOfTwoThatAreAlikeIsNamedBesideOthers) {
  ThrownModel model({Vec3d(12.0, 0.0, 3.0)});
  Effect shaking =
      effect("shaking", "outside",
             {number("x", "m/s²", 0.2), number("y", "m/s²", 0.2), number("z", "m/s²", 0.2)});
  shaking.confused_with = {"gravity_direction"};
  model.effects_.push_back(shaking);
  model.record({cause_of(model, {"gravity_direction", {0.02, -0.03}}),
                cause_of(model, {"drag_quadratic", {0.01}}), cause_of(model, {"spin", {0.3}})},
               {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kSeveral) << told_by_report(report);
  EXPECT_THAT(report.classes, UnorderedElementsAre("gravity_direction", "drag_quadratic", "spin"))
      << told_by_report(report);
}

TEST(Diagnose, WhatNoEffectKnowsIsUnknown) {
  ThrownModel model = two_throws();
  model.unknown_push = 0.01;
  model.record({}, {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kUnknown) << told_by_report(report);
  EXPECT_TRUE(report.classes.empty());
  ASSERT_FALSE(report.wrong.empty());
  // The bump stands at .45 of a clip of 24 frames, three frames wide.
  EXPECT_NEAR(report.wrong.front().frame, 10, 4);
}

/// A kick in flight is done nearly as well by several causes together, such as a shaking beside a
/// tracker's lag, but what they leave says that they are not it.
TEST(Diagnose, SeveralCausesThatImitateAreNotNamed) {
  for (const double speed : {0.6, 1.5}) {
    ThrownModel model({Vec3d(4.0, 0.5, 3.0)});
    model.effects_.push_back(
        effect("shaking", "outside",
               {number("x", "m/s²", 0.2), number("y", "m/s²", 0.2), number("z", "m/s²", 0.2)}));
    model.unknown_kick = Vec3d(0.0, 0.0, speed);
    model.record({}, {});
    const Report report = diagnose(model);
    EXPECT_EQ(report.verdict, Verdict::kUnknown) << told_by_report(report);
  }
}

/// A known cause that explains nearly all is named although something smaller remains unknown.
TEST(Diagnose, WhatIsKnownIsNamedBesideWhatIsNot) {
  ThrownModel model = two_throws();
  model.unknown_push = 0.01;
  model.record({cause_of(model, {"drag_linear", {0.6}})}, {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kCause) << told_by_report(report);
  EXPECT_EQ(report.causes.front().effect, "drag_linear");
  EXPECT_TRUE(report.remains);
  EXPECT_THAT(report.headline, testing::HasSubstr("something else is missing too"));
}

TEST(Diagnose, AFreeLawIsLookedAtLast) {
  ThrownModel model = two_throws();
  model.add_law();
  model.record({cause_of(model, {"law", {0.02}})}, {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kUnknown) << told_by_report(report);
  EXPECT_TRUE(std::ranges::none_of(report.causes,
                                   [](const Cause& cause) { return cause.effect == "law"; }));
  ASSERT_TRUE(report.law && report.law->refitted) << told_by_report(report);
  EXPECT_EQ(report.law->end, LawTrial::End::kImproves);
  EXPECT_GT(report.law->explained, 0.9);
  EXPECT_GT(report.law->gain, 0.9);
  EXPECT_NEAR(report.law->parameters.front().value, 0.02, 2e-3);
  ASSERT_EQ(report.extended.causes.size(), 1U);
  EXPECT_EQ(report.extended.causes.front().effect, model.effect_index("law"));
  EXPECT_THAT(report.headline, testing::HasSubstr("A law of another form explains"));
}

/// No bend can make what acts on the whole body; without anything left the law stays as it is.
TEST(Diagnose, AFreeLawTakesNothingFromWhatIsOutsideTheBody) {
  ThrownModel model = two_throws();
  model.add_law();
  model.record({cause_of(model, {"drag_linear", {0.6}})}, {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kCause) << told_by_report(report);
  EXPECT_LT(report.causes.front().absorbed, 0.2);
  ASSERT_TRUE(report.law.has_value());
  EXPECT_FALSE(report.law->refitted);
  ASSERT_EQ(report.extended.causes.size(), 1U);
  EXPECT_EQ(report.extended.causes.front().effect, model.effect_index("drag_linear"));
}

TEST(Diagnose, AFreeLawIsFoundBesideWhatIsNamed) {
  ThrownModel model = two_throws();
  model.add_law();
  model.record({cause_of(model, {"drag_linear", {0.6}}), cause_of(model, {"law", {0.02}})}, {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kCause) << told_by_report(report);
  EXPECT_THAT(report.classes, ElementsAre("drag_linear"));
  ASSERT_TRUE(report.law && report.law->refitted) << told_by_report(report);
  EXPECT_EQ(report.law->end, LawTrial::End::kImproves);
  // It is credited with what the drag leaves, and values are those of both together.
  EXPECT_GT(report.law->explained, 0.8);
  EXPECT_THAT(report.headline, testing::HasSubstr("of what is left"));
  ASSERT_EQ(report.extended.causes.size(), 2U);
  EXPECT_EQ(report.extended.causes[0].values[0], report.causes.front().parameters.front().value);
  EXPECT_NEAR(report.extended.causes[0].values[0], 0.6, 0.02);
}

/// A law could do all that its twin does; named it is nevertheless, as a law comes last.
TEST(Diagnose, WhatALawCouldMakeIsSaid) {
  ThrownModel model = two_throws();
  model.effects_.push_back(effect("like_law", "material", {number("bend", "m", 0.01)}));
  model.add_law();
  model.record({cause_of(model, {"like_law", {0.02}})}, {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kCause) << told_by_report(report);
  EXPECT_THAT(report.classes, ElementsAre("like_law"));
  EXPECT_GT(report.causes.front().absorbed, 0.9);
  EXPECT_FALSE(report.law->refitted);
}

TEST(Diagnose, NothingHiddenLeavesTheLawAsItIs) {
  ThrownModel model = two_throws();
  model.add_law();
  model.record({}, {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kNothing) << told_by_report(report);
  ASSERT_TRUE(report.law.has_value());
  EXPECT_FALSE(report.law->refitted);
  EXPECT_TRUE(report.extended.causes.empty());
}

TEST(Diagnose, TheSameModelGivesTheSameReport) {
  ThrownModel model = two_throws();
  model.record({cause_of(model, {"scale", {0.02}})}, {});
  const Report a = diagnose(model);
  const Report b = diagnose(model);
  EXPECT_EQ(a.headline, b.headline);
  EXPECT_EQ(a.threshold, b.threshold);
  ASSERT_EQ(a.causes.size(), b.causes.size());
  for (std::size_t k = 0; k < a.causes.size(); ++k) {
    EXPECT_EQ(a.causes[k].probability, b.causes[k].probability);
    EXPECT_EQ(a.causes[k].gain_low, b.causes[k].gain_low);
  }
}

TEST(Diagnose, EndsWhereItsSimulationsAreUsedUpAndSaysSo) {
  ThrownModel model = two_throws();
  model.record({cause_of(model, {"drag_linear", {0.1}})}, {});
  const Report whole = diagnose(model);
  EXPECT_FALSE(whole.cut);
  DiagnoseOptions options;
  options.most_runs = 10;
  const Report report = diagnose(model, options);
  EXPECT_TRUE(report.cut);
  // Each search that had not begun still looks where it would begin, and once more at its end.
  const auto of_searches = [](const Report& of) {
    int sum = 0;
    for (const auto& [stage, runs] : of.by_stage) sum += stage.ends_with("refits") ? runs : 0;
    return sum;
  };
  EXPECT_LT(of_searches(report), of_searches(whole) / 2);
  // Dear simulations count as several.
  options.most_runs = 60;
  const int cheap = of_searches(diagnose(model, options));
  model.work_of_each = 6.0;
  EXPECT_LT(of_searches(diagnose(model, options)), cheap);
  EXPECT_FALSE(report.causes.empty());
}

TEST(Diagnose, ProposesTheThrowThatSeparatesAClass) {
  // Slow throws cannot tell the laws of drag apart.
  ThrownModel model({Vec3d(3.0, 0.0, 1.0)});
  for (Use& use : model.captures_[0].use) use = Use::kUsed;
  model.experiments_ = {{"fast", "Throw it fast and sideways.", model.captures_[0]}};
  model.record({cause_of(model, {"drag_quadratic", {0.0006}})}, {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kClass) << told_by_report(report);
  EXPECT_EQ(report.next_recording, "Throw it fast and sideways.") << told_by_report(report);
  EXPECT_THAT(report.classes, Contains("drag_quadratic"));
  EXPECT_THAT(report.classes, Contains("drag_linear"));
}

TEST(Diagnose, ProposesARecordingAlthoughTwoOfTheClassAreAlikeInAny) {
  ThrownModel model({Vec3d(3.0, 0.0, 1.0)});
  for (Use& use : model.captures_[0].use) use = Use::kUsed;
  model.effects_.push_back(effect("drag_twin", "outside", {number("rate", "1/m", 0.05, true)}));
  model.experiments_ = {{"fast", "Throw it fast and sideways.", model.captures_[0]}};
  model.record({cause_of(model, {"drag_quadratic", {0.0006}})}, {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kClass) << told_by_report(report);
  EXPECT_THAT(report.next_recording,
              StartsWith("Throw it fast and sideways. drag_quadratic and drag_twin stay alike"))
      << told_by_report(report);
}

/// A block on a slope that sticks as long as friction is above the slope's tangent.
class SlopeModel : public HiddenModel {
 public:
  static constexpr double kFriction = 0.5;
  static constexpr double kSlope = 0.35;  // [rad]
  SlopeModel() {
    Capture capture;
    capture.name = "slope";
    for (int f = 0; f < 24; ++f) capture.times.push_back(f / 30.0);
    for (int i = 0; i < 8; ++i) {
      capture.rest.emplace_back(0.1 * (i & 1), 0.1 * ((i >> 1) & 1), 0.1 * (i >> 2));
    }
    capture.use.assign(std::size_t(capture.samples()), Use::kUsed);
    captures_ = {std::move(capture)};
    parameters_ = {parameter("place", 0.0, 0.1, -5.0, 5.0)};
    Effect friction = effect("friction", "contact", {number("added", "", 0.05)});
    friction.numbers[0].low = -kFriction;
    friction.tries = {-0.6 * kFriction, -0.3 * kFriction, 0.3 * kFriction};
    effects_ = {
        friction,
        effect("camera_drift", "measurement",
               {number("x", "m/s", 0.02), number("y", "m/s", 0.02), number("z", "m/s", 0.02)},
               Observation::kDrift),
        effect("scale", "measurement", {number("excess", "", 0.02)}, Observation::kScale)};
  }

 protected:
  Motion motion(const Point& point) const override {
    double mu = kFriction;
    for (const Point::Cause& cause : point.causes) {
      if (effects_[std::size_t(cause.effect)].name == "friction") mu += cause.values[0];
    }
    const double down = 9.81 * std::max(0.0, std::sin(kSlope) - mu * std::cos(kSlope));
    const Capture& capture = captures_[0];
    Motion result{Eigen::VectorXd(3 * capture.samples()), Eigen::VectorXd(3 * capture.samples())};
    Eigen::Index row = 0;
    for (const double t : capture.times) {
      for (const Vec3d& rest : capture.rest) {
        result.positions.segment<3>(row) =
            rest + Vec3d(point.theta[0] + 0.5 * down * t * t, 0.0, 0.0);
        result.velocities.segment<3>(row) = Vec3d(down * t, 0.0, 0.0);
        row += 3;
      }
    }
    return result;
  }
};

TEST(Diagnose, WhatSticksIsFoundToSlip) {
  SlopeModel model;
  model.record({cause_of(model, {"friction", {-0.3}})}, {});
  const Report report = diagnose(model);
  ASSERT_THAT(report.classes, ElementsAre("friction")) << told_by_report(report);
  EXPECT_NEAR(report.causes[0].parameters[0].value, -0.3,
              4.0 * report.causes[0].parameters[0].error)
      << told_by_report(report);
}

struct InChain {
  std::string effect;
  double value;
  int variant;
};

class ChainHides : public testing::TestWithParam<InChain> {};

TEST_P(ChainHides, IsNamedWithItsPlace) {
  ChainModel model;
  const auto& [effect, value, variant] = GetParam();
  model.record({cause_of(model, {effect, {value}}, variant)}, {});
  const Report report = diagnose(model);
  ASSERT_THAT(report.classes, ElementsAre(effect)) << told_by_report(report);
  EXPECT_EQ(report.causes[0].variant, variant) << told_by_report(report);
  EXPECT_NEAR(report.causes[0].parameters[0].value, value,
              4.0 * report.causes[0].parameters[0].error)
      << told_by_report(report);
  EXPECT_GT(report.causes[0].gain, 0.8) << told_by_report(report);
}

INSTANTIATE_TEST_SUITE_P(Chain, ChainHides,
                         testing::Values(InChain{"damping_shear", 1e-3, 0},
                                         InChain{"drag_linear", 0.5, 0},
                                         InChain{"attached_mass", 0.5, 2},
                                         InChain{"stiffness_inclusion", -0.3, 1}),
                         [](const auto& info) { return info.param.effect; });

TEST(Diagnose, ACoarseSolverIsNumericalAndNotDamping) {
  ChainModel model(20);
  model.record({}, {});
  const Report report = diagnose(model);
  EXPECT_EQ(report.verdict, Verdict::kNumerical) << told_by_report(report);
  // Without the solver's own error in the covariance it is a confident wrong name.
  DiagnoseOptions exact;
  exact.members = 0;
  EXPECT_NE(diagnose(model, exact).verdict, Verdict::kNothing);
}

TEST(Diagnose, DampingIsFoundBesideACoarseSolver) {
  ChainModel model(60);
  model.record({cause_of(model, {"attached_mass", {0.5}}, 2)}, {});
  const Report report = diagnose(model);
  EXPECT_THAT(report.classes, ElementsAre("attached_mass")) << told_by_report(report);
}

}  // namespace
}  // namespace matterfit::diagnose
