// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "diagnose/diagnose.hpp"
#include "diagnose/models_for_test.hpp"
#include "diagnose/spread.hpp"

namespace matterfit::diagnose {
namespace {

/// A body that is thrown onto a floor. The simulator's bounces keep another share of the speed than
/// the world's, by its grid; each of the first two has a velocity after it that is free.
class BounceModel : public HiddenModel {
 public:
  explicit BounceModel(bool corrected) : corrected_(corrected) {
    Capture capture;
    capture.name = "bounces";
    for (int f = 0; f < 40; ++f) capture.times.push_back(f / 48.0);
    for (int row = 0; row < 3; ++row) {
      for (int i = 0; i < 4; ++i) {
        capture.rest.emplace_back(0.05 * i, 0.04 * row, 0.01 * ((row + i) % 3));
      }
    }
    capture.use.assign(std::size_t(capture.samples()), Use::kUsed);
    const std::size_t later = 30 * capture.rest.size();
    for (std::size_t s = later; s < capture.use.size(); ++s) capture.use[s] = Use::kHeldOut;
    capture.noise = 5e-4;
    captures_ = {std::move(capture)};
    const std::array<double, 3> thrown{1.2, 0.3, -0.5};
    for (std::size_t a = 0; a < 3; ++a) {
      parameters_.push_back(
          parameter("velocity " + std::to_string(a), thrown[a], 0.1, -50.0, 50.0));
    }
    for (std::size_t k = 0; k < 6 && corrected_; ++k) {
      fit::Parameter number =
          parameter("impact " + std::to_string(k), 0.0, kImpactSigma, -10.0, 10.0);
      number.prior = fit::Prior{0.0, kImpactSigma};
      parameters_.push_back(std::move(number));
    }
    effects_ = {effect("drag_linear", "outside", {number("rate", "1/s", 0.2, true)}),
                effect("wind", "outside", {number("x", "m/s²", 0.2), number("y", "m/s²", 0.2)}),
                effect("gravity_size", "outside", {number("excess", "", 0.05)})};
  }
  bool has_numerics() const override { return true; }
  std::vector<Eigen::Index> corrections() const override {
    return corrected_ ? std::vector<Eigen::Index>{3, 4, 5, 6, 7, 8} : std::vector<Eigen::Index>{};
  }

 protected:
  Motion truth(const Point& point) const override { return move(point, 0.74, 0.36); }
  Motion motion(const Point& point) const override {
    return move(point, 0.70 + 0.1 * (point.numerics.spacing - 1.0),
                0.40 + 0.2 * (point.numerics.offset.x() - 0.5));
  }

 private:
  static constexpr double kImpactSigma = 0.1;

  /// `kept` of the speed down, `slid`: friction as a share of the impulse.
  Motion move(const Point& point, double kept, double slid) const {
    double drag = 0.0;
    Vec3d pull(0.0, 0.0, -9.81);
    for (const Point::Cause& cause : point.causes) {
      const std::string& name = effects_[std::size_t(cause.effect)].name;
      if (name == "drag_linear") drag = cause.values[0];
      if (name == "wind") pull += Vec3d(cause.values[0], cause.values[1], 0.0);
      if (name == "gravity_size") pull.z() *= 1.0 + cause.values[0];
    }
    const Capture& capture = captures_[0];
    Motion result{Eigen::VectorXd(3 * capture.samples()), {}};
    Vec3d x(0.0, 0.0, 0.3);
    Vec3d v = point.theta.head<3>();
    Eigen::Index impact = 0;
    Eigen::Index row = 0;
    for (std::size_t f = 0; f < capture.times.size(); ++f) {
      double left = f > 0 ? capture.times[f] - capture.times[f - 1] : 0.0;
      while (left > 0.0) {
        // The flight is a parabola in one step; drag acts as an average.
        const Vec3d a = pull - drag * v;
        const double root = std::sqrt(std::max(0.0, v.z() * v.z() - 2.0 * a.z() * x.z()));
        const double hit = (v.z() + root) / -a.z();
        const double dt = std::min(left, hit);
        x += dt * v + 0.5 * dt * dt * a;
        v += dt * a;
        left -= dt;
        if (dt < hit) continue;
        const double impulse = (1.0 + kept) * -v.z();
        v.z() *= -kept;
        const Vec3d across(v.x(), v.y(), 0.0);
        v -= std::min(1.0, 0.1 * slid * impulse / across.norm()) * across;
        if (corrected_ && impact < 2) v += point.theta.segment<3>(3 + 3 * impact);
        ++impact;
      }
      for (const Vec3d& rest : capture.rest) {
        result.positions.segment<3>(row) = x + rest;
        row += 3;
      }
    }
    return result;
  }

  bool corrected_;
};

TEST(Corrections, ABounceThatIsOffIsNoCause) {
  BounceModel model(true);
  model.record({}, {});
  const Report report = diagnose(model);
  EXPECT_TRUE(report.classes.empty()) << report.headline;
  EXPECT_NE(report.verdict, Verdict::kCause) << report.headline;
}

TEST(Corrections, DragIsFoundBesideBouncesThatAreOff) {
  BounceModel model(true);
  model.record({{model.effect_index("drag_linear"), 0, Eigen::VectorXd::Constant(1, 0.5)}}, {});
  const Report report = diagnose(model);
  ASSERT_EQ(report.verdict, Verdict::kCause) << report.headline;
  EXPECT_EQ(report.causes.front().effect, "drag_linear");
  EXPECT_NEAR(report.causes.front().parameters.front().value, 0.5, 0.15);
}

/// Without them the solver's own error grows from bounce to bounce, and what is not there is said,
/// or what is there is not.
TEST(Corrections, AreWhatTellsDragFromBouncesThatAreOff) {
  BounceModel model(false);
  model.record({{model.effect_index("drag_linear"), 0, Eigen::VectorXd::Constant(1, 0.5)}}, {});
  const Report report = diagnose(model);
  const bool found = report.verdict == Verdict::kCause &&
                     report.causes.front().effect == "drag_linear" &&
                     std::abs(report.causes.front().parameters.front().value - 0.5) < 0.15;
  EXPECT_FALSE(found) << report.headline;
}

/// The members of the ensemble differ by little once their bounces are corrected.
TEST(Corrections, TakeTheSolversOwnErrorOfImpacts) {
  const auto spread_of = [](bool corrected) {
    BounceModel model(corrected);
    model.record({}, {});
    const Study study(model, 12000);
    const State state = study.fitted();
    const Linearised slopes = linearise(study, state, {}, {});
    const Spread spread = numerical_spread(study, state, slopes.theta, {.directions = false});
    return std::sqrt(spread.members.topRows(study.used().size()).squaredNorm() /
                     double(spread.members.cols() * study.used().size()));
  };
  EXPECT_GT(spread_of(false), 2e-3);
  EXPECT_LT(spread_of(true), 2e-4);
}

/// A thrown body of which the solver does not know how long it was held in frame 4.
class HeldModel : public ThrownModel {
 public:
  HeldModel() : ThrownModel({Vec3d(2.0, 0.5, 1.0)}, 12) {}
  [[nodiscard]] bool has_numerics() const override { return true; }
  [[nodiscard]] std::vector<ContactFrame> contact_frames() const override {
    return {{0, 4, 2e-3, 0.03}};
  }
};

Eigen::MatrixXd contact_errors_of(const HeldModel& model, const Study& study) {
  const State state = study.fitted();
  const Linearised slopes = linearise(study, state, {}, {});
  const Spread spread = numerical_spread(study, state, slopes.theta, {});
  EXPECT_EQ(model.contact_frames().size(), 1U);
  return spread.directions.rightCols(6);
}

TEST(Spread, AContactMayHoldABodyOtherwise) {
  HeldModel model;
  model.record({}, {});
  const Eigen::Index tracks = model.captures().front().tracks();
  const Study as_simulated(model, 12000);
  EXPECT_LT(contact_errors_of(model, as_simulated).cwiseAbs().maxCoeff(), 0.5e-3);
  // Off by one standard deviation along each axis, and turned by none.
  for (Eigen::Index i = 0; i < tracks; ++i) {
    model.captures_.front().positions.segment<3>(3 * (4 * tracks + i)) += 2e-3 * Vec3d(1, -1, 1);
  }
  const Study study(model, 12000);
  const Eigen::MatrixXd errors = contact_errors_of(model, study);
  const Eigen::VectorXd x = study.measured();
  const Rows& rows = study.used();
  Eigen::Index seen = 0;
  const double place = errors.col(0).maxCoeff();
  EXPECT_NEAR(place, 2e-3 * std::sqrt(0.5), 2e-4);
  for (const Series& series : rows.series()) {
    for (Eigen::Index i = series.begin; i < series.end; ++i) {
      if (rows.frame(i) != 4) {
        EXPECT_EQ(errors.row(i).cwiseAbs().maxCoeff(), 0.0);
        continue;
      }
      ++seen;
      EXPECT_EQ(errors(i, series.axis), place);
      EXPECT_EQ(errors.row(i).head(3).squaredNorm(), place * place);
      EXPECT_EQ(errors(i, 3 + series.axis), 0.0) << "a turn moves nothing along its axis";
    }
  }
  EXPECT_EQ(seen, 3 * tracks);
  // Each turn is about the tracks' centre, and rigid: it leaves every distance to first order.
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d sum = Vec3d::Zero();
    double stretch = 0.0;
    std::vector<std::pair<Vec3d, Vec3d>> moved(static_cast<std::size_t>(tracks));
    for (const Series& series : rows.series()) {
      for (Eigen::Index i = series.begin; i < series.end; ++i) {
        if (rows.frame(i) != 4) continue;
        auto& [at, change] = moved[std::size_t(series.track)];
        at[series.axis] = x[i];
        change[series.axis] = errors(i, 3 + axis);
        sum[series.axis] += errors(i, 3 + axis);
      }
    }
    EXPECT_LT(sum.norm(), 1e-12);
    for (const auto& [at, change] : moved) {
      EXPECT_GT(change.norm(), 0.0);
      stretch = std::max(stretch, std::abs((at - moved[0].first).dot(change - moved[0].second)));
    }
    EXPECT_LT(stretch, 1e-12);
  }
}

}  // namespace
}  // namespace matterfit::diagnose
