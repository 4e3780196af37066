// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/parameter.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

using testing::HasSubstr;

constexpr double kNotSet = std::numeric_limits<double>::quiet_NaN();

Parameter modulus() {
  Parameter parameter;
  parameter.name = "bodies.dough.material.E";
  parameter.unit = "Pa";
  parameter.coordinate = Coordinate::kLog;
  parameter.start = 1e5;
  parameter.low = 1e2;
  parameter.high = 1e10;
  return parameter;
}

std::string refusal(const Parameter& parameter) {
  try {
    check(parameter);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  return "";
}

TEST(Parameter, CoordinatesHaveTheirFormulas) {
  EXPECT_DOUBLE_EQ(to_natural(Coordinate::kLinear, -3.5), -3.5);
  EXPECT_DOUBLE_EQ(to_natural(Coordinate::kLog, 1e5), 5.0 * std::log(10.0));
  EXPECT_DOUBLE_EQ(to_natural(Coordinate::kLogit, 0.25), 0.0);
  EXPECT_DOUBLE_EQ(to_natural(Coordinate::kLogit, 0.4), std::log(4.0));
}

TEST(Parameter, CoordinatesGoBackAndForth) {
  for (const double x : {1e-4, 0.1, 0.25, 0.3, 0.49, 0.499999}) {
    for (const Coordinate c : {Coordinate::kLinear, Coordinate::kLog, Coordinate::kLogit}) {
      EXPECT_NEAR(from_natural(c, to_natural(c, x)), x, 1e-14) << x;
    }
  }
  // Far out the coordinate neither overflows nor leaves its range.
  EXPECT_EQ(from_natural(Coordinate::kLogit, -800.0), 0.0);
  EXPECT_EQ(from_natural(Coordinate::kLogit, 800.0), 0.5);
}

TEST(Parameter, DerivativesAreThoseOfTheInverse) {
  for (const Coordinate c : {Coordinate::kLinear, Coordinate::kLog, Coordinate::kLogit}) {
    for (const double at : {-3.0, -0.2, 0.0, 1.0, 4.0}) {
      const double h = 1e-5;
      const double expected = (from_natural(c, at + h) - from_natural(c, at - h)) / (2.0 * h);
      EXPECT_NEAR(derivative(c, at), expected, 1e-9 * (1.0 + std::abs(expected))) << at;
    }
  }
}

TEST(Parameter, AcceptsWhatItsCoordinateAllows) {
  EXPECT_EQ(refusal(modulus()), "");
  Parameter at_bound = modulus();
  at_bound.start = at_bound.low;
  EXPECT_EQ(refusal(at_bound), "");
  Parameter ratio;
  ratio.coordinate = Coordinate::kLogit;
  ratio.start = 0.3;
  ratio.low = 0.01;
  ratio.high = 0.495;
  EXPECT_EQ(refusal(ratio), "");
  // A value that was clamped in the natural coordinate may be a rounding error outside.
  ratio.start = from_natural(Coordinate::kLogit, to_natural(Coordinate::kLogit, ratio.high));
  EXPECT_EQ(refusal(ratio), "");
}

TEST(Parameter, RefusesWithItsName) {
  const auto refused = [](auto change) {
    Parameter parameter = modulus();
    change(parameter);
    const std::string message = refusal(parameter);
    EXPECT_THAT(message, HasSubstr("bodies.dough.material.E: "));
    return message;
  };
  EXPECT_THAT(refused([](Parameter& p) { p.start = 1e11; }), HasSubstr("outside its bounds"));
  EXPECT_THAT(refused([](Parameter& p) { p.start = 50.0; }), HasSubstr("outside its bounds"));
  EXPECT_THAT(refused([](Parameter& p) { p.start = -1.0; }), HasSubstr("outside its bounds"));
  EXPECT_THAT(refused([](Parameter& p) { p.start = kNotSet; }), HasSubstr("outside its bounds"));
  EXPECT_THAT(refused([](Parameter& p) { p.low = 0.0; }), HasSubstr("above 0"));
  EXPECT_THAT(refused([](Parameter& p) { p.high = p.low; }), HasSubstr("the lower first"));
  EXPECT_THAT(refused([](Parameter& p) { p.high = kNotSet; }), HasSubstr("finite"));
  EXPECT_THAT(refused([](Parameter& p) { p.scale = 0.0; }), HasSubstr("scale"));
  EXPECT_THAT(refused([](Parameter& p) { p.prior = Prior{1.0, 0.0}; }), HasSubstr("sigma"));
  EXPECT_THAT(refused([](Parameter& p) { p.prior = Prior{kNotSet, 1.0}; }), HasSubstr("mean"));
  EXPECT_THAT(refused([](Parameter& p) {
                p.coordinate = Coordinate::kLogit;
                p.start = 0.3;
                p.low = 0.01;
                p.high = 0.5;
              }),
              HasSubstr("between 0 and 0.5"));
}

}  // namespace
}  // namespace matterfit::fit
