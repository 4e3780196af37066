// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/diagnose.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <iostream>

#include "diagnose/models_for_test.hpp"

namespace matterfit::diagnose {
namespace {

using testing::Contains;
using testing::ElementsAre;

ThrownModel two_throws() { return ThrownModel({Vec3d(2.0, 0.5, 1.0), Vec3d(9.0, -1.0, 3.0)}); }

std::string told(const Report& report) {
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
  ASSERT_THAT(report.classes, ElementsAre(GetParam().effect)) << told(report);
  EXPECT_EQ(report.verdict,
            report.causes[0].group == "measurement" ? Verdict::kMeasurement : Verdict::kCause);
  const Cause& cause = report.causes[0];
  EXPECT_EQ(cause.effect, GetParam().effect);
  EXPECT_TRUE(cause.accepted);
  EXPECT_GT(cause.probability, 0.9) << told(report);
  for (std::size_t k = 0; k < GetParam().values.size(); ++k) {
    EXPECT_NEAR(cause.parameters[k].value, GetParam().values[k], 4.0 * cause.parameters[k].error)
        << told(report);
  }
  if (cause.gain_measurable) {
    EXPECT_GT(cause.gain, 0.8) << told(report);
    EXPECT_LT(cause.holdout_after, cause.free_field);
    EXPECT_LT(cause.holdout_after, cause.last_residual);
  }
  EXPECT_LT(cause.holdout_after, cause.holdout_before);
}

INSTANTIATE_TEST_SUITE_P(
    Thrown, HidesOne,
    testing::Values(Hidden{"gravity_size", {0.05}}, Hidden{"gravity_direction", {0.02, -0.03}},
                    Hidden{"drag_linear", {0.1}}, Hidden{"drag_quadratic", {0.03}},
                    Hidden{"force_field", {0.5}}, Hidden{"spin", {0.3}},
                    Hidden{"time_offset", {0.004}}, Hidden{"frame_rate", {0.02}},
                    Hidden{"scale", {0.02}}, Hidden{"camera_roll", {0.02}},
                    Hidden{"tracker_lag", {0.01}}),
    [](const auto& info) { return info.param.effect; });

TEST(Diagnose, PrintsForNow) {
  for (const double correlation : {0.0, 0.8}) {
    int alarms = 0;
    for (int seed = 0; seed < 40; ++seed) {
      ThrownModel model = two_throws();
      TestNoise noise;
      noise.correlation = correlation;
      noise.seed = std::uint64_t(seed) + 1;
      model.record({}, noise);
      const Report report = diagnose(model);
      if (report.verdict != Verdict::kNothing) {
        ++alarms;
        std::cout << told(report) << "\n";
      }
      if (seed == 0) {
        std::cout << report.noise.sigma << " " << report.noise.autocorrelation << " "
                  << report.noise.common_sigma << " T* " << report.threshold << " runs "
                  << report.runs << "\n";
      }
    }
    std::cout << correlation << " alarms " << alarms << "\n";
  }
}

}  // namespace
}  // namespace matterfit::diagnose
