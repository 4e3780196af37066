// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>

#include "diagnose/diagnose.hpp"
#include "diagnose/models_for_test.hpp"

/// Real balls dropped from a bridge (de Silva et al. 2020), with a point that falls.
namespace matterfit::diagnose {
namespace {

using testing::Contains;
using testing::IsSupersetOf;
using testing::Not;

struct Ball {
  const char* file;
  double ounces;
  double circumference_cm;
};
// Weights and circumferences as the recordings' own table gives them.
const std::vector<Ball> kBalls = {
    {"baseball_1", 5.0, 22.25},          {"blue_basketball_1", 18.0, 75.0},
    {"green_basketball_1", 16.0, 73.25}, {"bowling_ball_1", 81.0, 67.0},
    {"golf_ball_1", 1.62, 13.8},         {"tennis_ball_1", 2.0, 20.75},
    {"whiffle_ball_1_1", 1.0, 22.8}};
constexpr double kAir = 1.2;  // kg/m³

class BallModel : public Model {
 public:
  /// Reads the balls; `held` are held out whole, of the others frames from `share` on.
  BallModel(const std::vector<Ball>& balls, const std::vector<std::string>& held, double share) {
    for (const Ball& ball : balls) {
      Capture capture;
      capture.name = ball.file;
      std::ifstream file(std::string(MATTERFIT_DATA_DIR) + "/balls/" + ball.file + ".csv");
      std::string line;
      std::getline(file, line);
      std::vector<double> heights;
      while (std::getline(file, line)) {
        const std::size_t comma = line.find(',');
        capture.times.push_back(std::stod(line.substr(0, comma)));
        heights.push_back(std::stod(line.substr(comma + 1)));
      }
      capture.rest = {Vec3d::Zero()};
      capture.axes = {false, false, true};
      capture.positions = Eigen::VectorXd::Zero(3 * Eigen::Index(heights.size()));
      for (std::size_t f = 0; f < heights.size(); ++f) {
        capture.positions[3 * Eigen::Index(f) + 2] = heights[f];
      }
      const bool whole = std::ranges::count(held, std::string(ball.file)) > 0;
      capture.use.assign(heights.size(), whole ? Use::kHeldOut : Use::kUsed);
      for (std::size_t f = 0; f < heights.size(); ++f) {
        if (!whole && double(f) >= share * double(heights.size())) capture.use[f] = Use::kHeldOut;
      }
      const double fall = heights.front();
      parameters_.push_back(parameter(std::string(ball.file) + ".height", fall, 0.1, 0.0, 100.0));
      parameters_.push_back(parameter(std::string(ball.file) + ".speed", 0.0, 0.1, -20.0, 20.0));
      own_.insert(own_.end(), 2, int(captures_.size()));
      mass_.push_back(ball.ounces * 0.0283495);
      radius_.push_back(ball.circumference_cm * 0.01 / (2.0 * std::numbers::pi));
      captures_.push_back(std::move(capture));
    }
    effects_ = {
        effect("gravity_size", "outside", {number("excess", "", 0.05, false, 0.5)}),
        effect("drag_linear", "outside", {number("coefficient", "kg/(m s)", 0.1, true)}),
        effect("drag_quadratic", "outside", {number("c_d", "", 0.5, true, 5.0)}),
        effect("buoyancy", "outside", {number("air_density", "kg/m³", 1.2, true, 50.0)}),
        effect("force_field", "outside", {number("force", "N", 0.05)}),
        effect("frame_rate", "measurement", {number("excess", "", 0.02, false, 0.3)},
               Observation::kFrameRate),
        effect("scale", "measurement", {number("excess", "", 0.02, false, 0.3)},
               Observation::kScale),
        effect("time_offset", "measurement", {number("offset", "s", 0.02)},
               Observation::kTimeOffset),
    };
  }
  const std::vector<Capture>& captures() const override { return captures_; }
  const std::vector<fit::Parameter>& parameters() const override { return parameters_; }
  std::vector<int> own_capture() const override { return own_; }
  const std::vector<Effect>& effects() const override { return effects_; }
  bool has_numerics() const override { return false; }
  std::vector<std::optional<Motion>> simulate(const std::vector<Point>& points) const override {
    std::vector<std::optional<Motion>> result;
    for (const Point& point : points) result.emplace_back(fall(point));
    return result;
  }

 private:
  Motion fall(const Point& point) const {
    Eigen::Index size = 0;
    for (const Capture& capture : captures_) size += 3 * capture.samples();
    Motion result{Eigen::VectorXd::Zero(size), Eigen::VectorXd::Zero(size)};
    Eigen::Index row = 0;
    for (std::size_t c = 0; c < captures_.size(); ++c) {
      const double m = mass_[c];
      const double r = radius_[c];
      double g = 9.81;
      double push = 0.0;
      double linear = 0.0;
      double quadratic = 0.0;
      double inertia = 1.0;
      for (const Point::Cause& cause : point.causes) {
        const std::string& name = effects_[std::size_t(cause.effect)].name;
        const double a = cause.values[0];
        if (name == "gravity_size") g *= 1.0 + a;
        if (name == "drag_linear") linear = a * r / m;
        if (name == "drag_quadratic") {
          quadratic = 0.5 * kAir * a * std::numbers::pi * r * r / m;
        }
        if (name == "buoyancy") {
          const double displaced = a * 4.0 / 3.0 * std::numbers::pi * r * r * r / m;
          push += displaced * 9.81;
          inertia += 0.5 * displaced;
        }
        if (name == "force_field") push += a / m;
      }
      double x = point.theta[Eigen::Index(2 * c)];
      double v = point.theta[Eigen::Index(2 * c + 1)];
      const auto rate = [&](double u) {
        return (-g + push - linear * u - quadratic * std::abs(u) * u) / inertia;
      };
      const std::vector<double>& times = captures_[c].times;
      for (std::size_t f = 0; f < times.size(); ++f) {
        if (f > 0) {
          const double h = times[f] - times[f - 1];
          const double a1 = rate(v);
          const double a2 = rate(v + 0.5 * h * a1);
          const double a3 = rate(v + 0.5 * h * a2);
          const double a4 = rate(v + h * a3);
          x += h * v + h * h / 6.0 * (a1 + a2 + a3);
          v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
        }
        result.positions[row + 2] = x;
        result.velocities[row + 2] = v;
        row += 3;
      }
    }
    return result;
  }
  std::vector<Capture> captures_;
  std::vector<fit::Parameter> parameters_;
  std::vector<int> own_;
  std::vector<Effect> effects_;
  std::vector<double> mass_;
  std::vector<double> radius_;
};

bool has_balls() {
  return std::filesystem::exists(std::string(MATTERFIT_DATA_DIR) + "/balls/golf_ball_1.csv");
}

std::string told(const Report& report) {
  std::string text = std::string(name(report.verdict)) + " explained " +
                     std::to_string(report.explained) + " " + report.headline;
  for (std::size_t i = 0; i < std::min<std::size_t>(5, report.causes.size()); ++i) {
    const Cause& cause = report.causes[i];
    text += "\n  " + cause.effect + " T=" + std::to_string(cause.score) + " gain " +
            std::to_string(cause.gain) + " [" + std::to_string(cause.gain_low) + "] " +
            std::to_string(cause.holdout_before) + " " + std::to_string(cause.holdout_after) +
            " floor " + std::to_string(cause.holdout_floor) + " field " +
            std::to_string(cause.free_field);
    for (const Value& value : cause.parameters) text += " " + with_error(value);
  }
  return text;
}

TEST(Balls, OneDropIsAClass) {
  if (!has_balls()) GTEST_SKIP() << "shared/data/balls is not here";
  // The light balls, whose drag is far above the noise.
  for (const std::size_t ball : {1U, 2U, 5U}) {
    const Report report = diagnose(BallModel({kBalls[ball]}, {}, 1.0));
    EXPECT_EQ(report.verdict, Verdict::kClass) << told(report);
    EXPECT_THAT(report.classes, IsSupersetOf({"gravity_size", "scale", "frame_rate"}))
        << kBalls[ball].file << " " << told(report);
  }
  EXPECT_THAT(diagnose(BallModel({kBalls[2]}, {}, 1.0)).classes, Contains("drag_quadratic"));
  EXPECT_THAT(diagnose(BallModel({kBalls[5]}, {}, 1.0)).classes, Contains("drag_quadratic"));
}

TEST(Balls, AllTogetherAreDragWhoseLawTheyCannotTell) {
  if (!has_balls()) GTEST_SKIP() << "shared/data/balls is not here";
  // The last three tenths of each fall are predicted.
  const Report report = diagnose(BallModel(kBalls, {}, 0.7));
  EXPECT_EQ(report.verdict, Verdict::kClass) << told(report);
  EXPECT_THAT(report.classes, IsSupersetOf({"drag_linear", "drag_quadratic"})) << told(report);
  // What one drop cannot exclude, seven balls of known mass and size do.
  EXPECT_THAT(report.classes, Not(Contains("gravity_size")));
  EXPECT_THAT(report.classes, Not(Contains("scale")));
  EXPECT_GT(report.causes[0].gain, 0.6) << told(report);
  EXPECT_GT(report.causes[0].gain_low, 0.0);
  for (const Cause& cause : report.causes) {
    if (cause.effect != "drag_quadratic") continue;
    EXPECT_NEAR(cause.parameters[0].value, 0.5, 0.1) << told(report);
  }
}

TEST(Balls, DragPredictsALightBallThatWasLeftOut) {
  if (!has_balls()) GTEST_SKIP() << "shared/data/balls is not here";
  const Report report = diagnose(BallModel(kBalls, {"tennis_ball_1"}, 1.0));
  EXPECT_THAT(report.classes, Contains("drag_quadratic")) << told(report);
  EXPECT_GT(report.causes[0].gain, 0.85) << told(report);
}

}  // namespace
}  // namespace matterfit::diagnose
