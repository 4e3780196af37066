// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/far_starts.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "diagnose/diagnose.hpp"
#include "diagnose/models_for_test.hpp"

namespace matterfit::diagnose {
namespace {

/// A beam that is let go and rings about where its weight bends it to: a mass on it, at its end or
/// at its middle, bends it farther and slows it, so does a softer material, in another proportion;
/// a force bends it alone. When it was let go is fitted.
class LoadedBeam : public HiddenModel {
 public:
  static constexpr double kBeam = 0.1;        ///< kg
  static constexpr double kStiffness = 65.0;  ///< N/m, of the end

  LoadedBeam() {
    Capture capture;
    capture.name = "beam";
    for (int f = 0; f < 120; ++f) capture.times.push_back(f / 100.0);
    for (int i = 0; i < 4; ++i) capture.rest.emplace_back(0.025 * (i + 1), 0.0, 0.0);
    capture.use.assign(std::size_t(capture.samples()), Use::kUsed);
    for (Eigen::Index f = 90; f < 120; ++f) {
      for (Eigen::Index i = 0; i < 4; ++i) capture.use[std::size_t(4 * f + i)] = Use::kHeldOut;
    }
    capture.noise = 2e-5;
    captures_ = {std::move(capture)};
    parameters_ = {parameter("start", 0.0, 0.005, -0.02, 0.02, fit::Coordinate::kLinear)};
    effects_ = {effect("mass", "state", {number("mass", "kg", 0.05 * kBeam, true)}),
                effect("pull", "outside", {number("force", "N", 0.1)}),
                effect("drag", "outside", {number("rate", "1/s", 0.5, true)}),
                effect("softer", "material", {number("less", "N/m", 5.0)})};
    effects_[3].numbers[0].low = -0.9 * kStiffness;
    effects_[3].tries = {-0.3 * kStiffness, -0.6 * kStiffness};
    effects_[0].variants = {"at the middle", "at the end"};
    effects_[0].far_tries = {0.15 * kBeam, 0.6 * kBeam, 1.2 * kBeam};
  }

 protected:
  Motion motion(const Point& point) const override {
    constexpr double kGravity = 9.81;
    double stiffness = kStiffness;
    double mass = 0.24 * kBeam;
    double load = 0.375 * kBeam * kGravity;
    double rate = 2.0;
    for (const Point::Cause& cause : point.causes) {
      const double value = cause.values[0];
      if (cause.effect == 0) {
        // The middle of a beam moves by 5/16 of its end.
        const double share = cause.variant == 0 ? 0.3125 : 1.0;
        mass += share * share * value;
        load += share * value * kGravity;
      }
      if (cause.effect == 1) load += value;
      if (cause.effect == 2) rate += value;
      if (cause.effect == 3) stiffness += value;
    }
    const double omega = std::sqrt(stiffness / mass);
    Motion result{Eigen::VectorXd::Zero(3 * captures_[0].samples()), {}};
    Eigen::Index row = 0;
    for (const double now : captures_[0].times) {
      const double t = std::max(0.0, now - 0.1 - point.theta[0]);
      for (const Vec3d& x : captures_[0].rest) {
        const double drop = std::pow(x.x() / 0.1, 2.0) * load / stiffness;
        const double swing = drop * (1.0 - std::exp(-rate * t) * std::cos(omega * t));
        result.positions.segment<3>(row) = x - Vec3d(0.0, 0.0, swing);
        row += 3;
      }
    }
    return result;
  }
};

Report of_a_load() {
  LoadedBeam model;
  const int mass = model.effect_index("mass");
  model.record({{mass, 1, Eigen::VectorXd::Constant(1, 0.052)}}, {.sigma = 2e-5});
  return diagnose(model, {});
}

/// A mass of half the beam's halves the frequency: by its slope at nothing it would be below 0.
TEST(FarStarts, FindAMassThatIsFarFromNothing) {
  const Report report = of_a_load();
  EXPECT_EQ(report.verdict, Verdict::kCause);
  ASSERT_FALSE(report.causes.empty());
  const Cause& cause = report.causes.front();
  EXPECT_EQ(cause.effect, "mass");
  EXPECT_EQ(cause.where, "at the end");
  EXPECT_NEAR(cause.parameters.front().value, 0.052, 0.001);
  EXPECT_GT(cause.gain, 0.9);
}

/// A softer material does a little of what the mass does and of the swing that dies away sooner.
TEST(FarStarts, FindAMassBesideADragThatTheSimulationLacksToo) {
  LoadedBeam model;
  model.record({{model.effect_index("mass"), 1, Eigen::VectorXd::Constant(1, 0.052)},
                {model.effect_index("drag"), 0, Eigen::VectorXd::Constant(1, 4.0)}},
               {.sigma = 2e-5});
  const Report report = diagnose(model, {});
  EXPECT_EQ(report.verdict, Verdict::kSeveral);
  ASSERT_GE(report.causes.size(), 2U);
  std::vector<std::string> named = {report.causes[0].effect, report.causes[1].effect};
  std::ranges::sort(named);
  EXPECT_EQ(named, (std::vector<std::string>{"drag", "mass"}));
}

TEST(FarStarts, TakeTheShapeAndSizeThatLeaveLeast) {
  LoadedBeam model;
  const int mass = model.effect_index("mass");
  model.record({{mass, 1, Eigen::VectorXd::Constant(1, 0.052)}}, {.sigma = 2e-5});
  const Study study(model, 12000);
  Noise noise;
  noise.captures.resize(1);
  noise.captures[0].sigma = 2e-5;
  noise.weights = Eigen::VectorXd::Ones(study.used().size());
  const Refitter refitter(study, noise, Spread::none(study.size()), {});
  const State base = study.fitted();
  const Linearised slopes = linearise(study, base, {}, {});
  const std::vector<Attempt> found = far_starts(refitter, base, slopes.theta, {});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].causes, (std::vector<Candidate>{{mass, 1}}));
  ASSERT_EQ(found[0].start.states.size(), 1U);
  // Nearer than the sizes that are named.
  EXPECT_NEAR(found[0].start.states[0].causes[0].values[0], 0.052, 0.01);
  EXPECT_TRUE(far_starts(refitter, base, slopes.theta, {mass}).empty());
}

}  // namespace
}  // namespace matterfit::diagnose
