// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/approach.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "diagnose/models_for_test.hpp"

namespace matterfit::diagnose {
namespace {

constexpr double kRings = 6.0;     // [Hz]
constexpr double kAstrayAt = 9.0;  // where a fit has ended: between two of its misfit's hills

/// A body that rings at a frequency that is fitted. Its misfit has a hill for every lag of a
/// period.
class RingingModel : public HiddenModel {
 public:
  RingingModel() {
    Capture capture;
    capture.name = "ringing";
    for (int f = 0; f < 40; ++f) capture.times.push_back(f / 48.0);
    for (int row = 0; row < 2; ++row) {
      for (int i = 0; i < 4; ++i) capture.rest.emplace_back(0.05 * i, 0.04 * row, 0.01 * i * row);
    }
    capture.use.assign(std::size_t(capture.samples()), Use::kUsed);
    capture.noise = 5e-4;
    captures_ = {std::move(capture)};
    parameters_ = {parameter("frequency", kRings, 0.05, 1.0, 20.0)};
    record({}, {});
    parameters_[0].start = kAstrayAt;
  }
  std::vector<Eigen::VectorXd> other_starts() const override { return others_; }

  std::vector<Eigen::VectorXd> others_;

 protected:
  Motion motion(const Point& point) const override {
    const Capture& capture = captures_[0];
    Motion result{Eigen::VectorXd(3 * capture.samples()), {}};
    Eigen::Index row = 0;
    for (const double time : capture.times) {
      const double swing = 0.02 * std::cos(2.0 * std::numbers::pi * point.theta[0] * time);
      for (const Vec3d& rest : capture.rest) {
        result.positions.segment<3>(row) = rest + swing * Vec3d(1.0, 0.5, rest.x() / 0.2);
        row += 3;
      }
    }
    return result;
  }
};

struct Ended {
  double frequency = 0.0;
  int runs = 0;
  bool elsewhere = false;
};

Ended approach(const RingingModel& model) {
  const Study study(model, 12000);
  const Approach near = come_near(study, study.fitted(), {});
  return {near.state.theta[0], study.runs(), near.elsewhere};
}

TEST(Approach, LeavesAFalseMinimumForABetterStart) {
  RingingModel model;
  EXPECT_GT(std::abs(approach(model).frequency - kRings), 1.0);
  for (const double start : {12.0, 6.2, 3.0}) {
    model.others_.push_back(Eigen::VectorXd::Constant(1, start));
  }
  const Ended end = approach(model);
  EXPECT_NEAR(end.frequency, kRings, 0.05);
  EXPECT_TRUE(end.elsewhere);
}

/// Other starts are not simulated where the fit has ended well.
TEST(Approach, StaysWhereTheFitIsGood) {
  RingingModel model;
  model.parameters_[0].start = kRings;
  const Ended alone = approach(model);
  EXPECT_NEAR(alone.frequency, kRings, 0.05);
  model.others_.push_back(Eigen::VectorXd::Constant(1, 6.2));
  const Ended beside = approach(model);
  EXPECT_EQ(beside.runs, alone.runs);
  EXPECT_FALSE(beside.elsewhere);
}

/// A fit that has gone astray may still leave less than the other starts.
TEST(Approach, KeepsTheSlopesOfTheFitWhereThatIsNearest) {
  RingingModel model;
  model.parameters_[0].start = kRings + 0.4;
  const Ended alone = approach(model);
  model.others_.push_back(Eigen::VectorXd::Constant(1, 12.0));
  const Ended beside = approach(model);
  EXPECT_FALSE(beside.elsewhere);
  EXPECT_EQ(beside.runs, alone.runs + 1);
  EXPECT_EQ(beside.frequency, alone.frequency);
}

}  // namespace
}  // namespace matterfit::diagnose
