// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/identify.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnose/models_for_test.hpp"

namespace matterfit::diagnose {
namespace {

using testing::Contains;
using testing::HasSubstr;

/// Something that slides: x = a t + b t + c t² with a and b tied, d nowhere to be seen.
class TiedModel : public HiddenModel {
 public:
  TiedModel() {
    Capture capture;
    capture.name = "slide";
    capture.axes = {true, false, false};
    for (int f = 0; f < 20; ++f) capture.times.push_back(0.1 * f);
    capture.rest = {Vec3d::Zero()};
    capture.use.assign(20, Use::kUsed);
    capture.noise = 1e-3;
    captures_ = {capture};
    for (const char* name : {"a", "b", "c", "d"}) {
      parameters_.push_back(parameter(name, 0.5, 0.1, -10.0, 10.0));
    }
    effects_ = {effect("scale", "measurement", {number("excess", "", 0.02)}, Observation::kScale)};
  }

 protected:
  Motion motion(const Point& point) const override {
    Motion result{Eigen::VectorXd::Zero(60), {}};
    for (Eigen::Index f = 0; f < 20; ++f) {
      const double t = captures_[0].times[std::size_t(f)];
      result.positions[3 * f] = (point.theta[0] + point.theta[1]) * t + point.theta[2] * t * t;
    }
    return result;
  }
};

TEST(Identify, SaysWhatIsKnownTiedAndInvisible) {
  TiedModel model;
  model.record({}, {1e-3});
  const BeforeFit known = identify(model);
  ASSERT_EQ(known.parameters.size(), 4U);
  EXPECT_FALSE(known.parameters[0].known);
  EXPECT_FALSE(known.parameters[1].known);
  EXPECT_TRUE(known.parameters[2].known);
  EXPECT_FALSE(known.parameters[3].known);
  EXPECT_NEAR(known.sigma, 1e-3, 1e-12);
  ASSERT_EQ(known.ties.size(), 1U);
  EXPECT_THAT(known.ties[0].names, testing::ElementsAre("a", "b"));
  EXPECT_THAT(known.statements, Contains(HasSubstr("d does not change anything")));
  EXPECT_THAT(known.statements, Contains(HasSubstr("a and b are tied")));
}

TEST(Identify, ErrorsAreThoseOfLeastSquares) {
  ThrownModel model({Vec3d(2.0, 0.5, 1.0)});
  model.record({}, {});
  model.captures_[0].noise = 5e-4;
  const BeforeFit known = identify(model);
  // A velocity along a straight line: σ² over Σ t², the noise being white.
  double squares = 0.0;
  const Capture& capture = model.captures_[0];
  for (std::size_t f = 0; f < capture.times.size(); ++f) {
    if (capture.use[f * capture.rest.size()] != Use::kUsed) continue;
    squares += double(capture.rest.size()) * capture.times[f] * capture.times[f];
  }
  const double expected = 5e-4 / std::sqrt(squares);
  EXPECT_NEAR(known.parameters[0].error, expected, 0.15 * expected);
  // A wrong scale would pass for a velocity.
  ASSERT_FALSE(known.assumptions.empty());
  EXPECT_GT(known.assumptions[0].errors, 1.0);
}

}  // namespace
}  // namespace matterfit::diagnose
