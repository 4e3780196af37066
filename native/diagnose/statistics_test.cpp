// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>

#include "base/error.hpp"
#include "diagnose/analysis.hpp"
#include "diagnose/chi_square.hpp"
#include "diagnose/gain.hpp"
#include "diagnose/models_for_test.hpp"
#include "diagnose/random.hpp"
#include "diagnose/refit.hpp"
#include "diagnose/spread.hpp"

/// The parts of the engine against what is known of them.
namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(ChiSquare, TailsAreThoseOfTables) {
  // Abramowitz and Stegun, table 26.8.
  EXPECT_NEAR(std::exp(log_chi_square_tail(3.84146, 1)), 0.05, 1e-6);
  EXPECT_NEAR(std::exp(log_chi_square_tail(9.21034, 2)), 0.01, 1e-7);
  EXPECT_NEAR(std::exp(log_chi_square_tail(7.81473, 3)), 0.05, 1e-6);
  EXPECT_NEAR(std::exp(log_chi_square_tail(18.3070, 10)), 0.05, 1e-6);
  // Far out, where the probability underflows: ln P ≈ −x/2 for two degrees of freedom.
  EXPECT_NEAR(log_chi_square_tail(4000.0, 2), -2000.0, 1e-9);
  EXPECT_NEAR(equivalent_of_one(9.21034, 2), 6.6349, 1e-3);
  EXPECT_LT(equivalent_of_one(5000.0, 3), 5000.0);
}

TEST(Noise, IsFoundBesideADiscrepancy) {
  ThrownModel model({Vec3d(2.0, 0.5, 1.0)}, 120);
  TestNoise noise;
  noise.correlation = 0.6;
  noise.sigma = 1e-3;
  noise.common = 2e-3;
  // A field that twists the throw by a hundred times the noise.
  model.record({{model.effect_index("force_field"), 0, VectorXd::Constant(1, 2.0)}}, noise);
  const Study study(model, 0);
  const Linearised slopes =
      linearise(study, study.fitted(), candidates_of(model, study.fitted()), {});
  const Spread none = Spread::none(study.size());
  const VectorXd left = (study.measured() - slopes.prediction).head(study.used().size());
  const Noise found = estimate_noise(study.used(), model.captures(), left,
                                     explained_columns(study, slopes, none, left), 1e-9);
  EXPECT_NEAR(found.captures[0].sigma, 1e-3, 1e-4);
  EXPECT_NEAR(found.captures[0].correlation, 0.6, 0.06);
  EXPECT_NEAR(found.captures[0].common_sigma, 2e-3, 6e-4);
  EXPECT_NEAR(found.captures[0].kurtosis, 0.0, 1.0);
}

/// A long catalogue has more columns than there are means of frames.
TEST(Noise, OfAllTracksIsFoundBesideManyColumns) {
  ThrownModel model({Vec3d(2.0, 0.5, 1.0)}, 40);
  TestNoise noise;
  noise.correlation = 0.8;
  noise.sigma = 1e-3;
  noise.common = 1e-3;
  noise.common_correlation = 0.8;
  model.record({}, noise);
  const Study study(model, 0);
  const Linearised slopes =
      linearise(study, study.fitted(), candidates_of(model, study.fitted()), {});
  const VectorXd left = (study.measured() - slopes.prediction).head(study.used().size());
  const MatrixXd few = explained_columns(study, slopes, Spread::none(study.size()), left);
  MatrixXd many(few.rows(), few.cols() + 300);
  Random random(7, 0);
  for (Index k = 0; k < 300; ++k) {
    for (Index i = 0; i < few.rows(); ++i) many(i, k) = random.normal();
  }
  many.rightCols(few.cols()) = few;
  many.colwise().normalize();
  const Noise found = estimate_noise(study.used(), model.captures(), left, many, 1e-9);
  EXPECT_NEAR(found.captures[0].sigma, 1e-3, 1.5e-4);
  EXPECT_NEAR(found.captures[0].common_sigma, 1e-3, 4e-4);
  EXPECT_NEAR(found.captures[0].common_correlation, 0.8, 0.15);
}

/// A noisy frame says where on the body the tracks are: what that gets wrong stays with a track and
/// turns with the body, and is neither a correlation in time nor a discrepancy.
TEST(Noise, TellsWrongPlacesFromNoise) {
  ThrownModel model({Vec3d(2.0, 0.5, 1.0)}, 40);
  TestNoise noise;
  noise.sigma = 1e-3;
  model.record({}, noise);
  const Study study(model, 0);
  const Linearised slopes =
      linearise(study, study.fitted(), candidates_of(model, study.fitted()), {});
  VectorXd residual = (study.measured() - slopes.prediction).head(study.used().size());
  Turns turns(1);
  for (std::size_t f = 0; f < model.captures()[0].times.size(); ++f) {
    turns[0].push_back(Eigen::AngleAxisd(0.08 * double(f), Vec3d::UnitY()).toRotationMatrix());
  }
  Random random(5, 0);
  for (const TrackRows& track : track_rows(study.used(), turns)) {
    const VectorXd wrong =
        2e-3 * track.shift * Vec3d(random.normal(), random.normal(), random.normal());
    MatrixXd moved = residual;
    track.scatter(track.gather(moved) + wrong, moved);
    residual = moved;
  }
  const Spread none = Spread::none(study.size());
  const Noise found = estimate_noise(study.used(), model.captures(), residual,
                                     explained_columns(study, slopes, none, residual), 1e-9, turns);
  EXPECT_NEAR(found.captures[0].sigma, 1e-3, 1e-4);
  EXPECT_NEAR(found.captures[0].correlation, 0.0, 0.1);
  EXPECT_NEAR(found.captures[0].place_sigma, 2e-3, 6e-4);
}

/// The noise of one capture, all rows.
Noise noise_of(const Rows& rows, double sigma, double correlation, double common) {
  Noise noise;
  TrackNoise track;
  track.sigma = sigma;
  track.correlation = correlation;
  track.interval = 1.0 / 30.0;
  track.common_sigma = common;
  track.common_correlation = 0.5;
  track.plausible.assign(5, correlation);
  noise.captures = {track};
  noise.weights = VectorXd::Ones(rows.size());
  return noise;
}

TEST(Whitening, MakesTheCovarianceTheIdentity) {
  ThrownModel model({Vec3d(2.0, 0.5, 1.0)}, 8, 2);
  const std::vector<Capture> captures = [&] {
    std::vector<Capture> result = model.captures();
    result[0].positions = VectorXd::Zero(3 * result[0].samples());
    return result;
  }();
  const Rows rows(captures, [](int, Index, Index) { return true; });
  Noise noise = noise_of(rows, 2.0, 0.7, 1.5);
  noise.captures[0].place_sigma = 0.8;
  noise.turns.resize(1);
  for (std::size_t f = 0; f < captures[0].times.size(); ++f) {
    noise.turns[0].push_back(
        Eigen::AngleAxisd(0.3 * double(f), Vec3d(1.0, 2.0, -1.0).normalized()).toRotationMatrix());
  }
  const MatrixXd spread = MatrixXd::Random(rows.size(), 3);
  MatrixXd covariance = spread * spread.transpose();
  for (const Series& a : rows.series()) {
    for (const Series& b : rows.series()) {
      for (Index i = a.begin; i < a.end; ++i) {
        for (Index j = b.begin; j < b.end; ++j) {
          if (a.track == b.track) {
            covariance(i, j) += 0.8 * 0.8 *
                                noise.turns[0][std::size_t(rows.frame(i))].row(a.axis).dot(
                                    noise.turns[0][std::size_t(rows.frame(j))].row(b.axis));
          }
          if (a.axis != b.axis) continue;
          const double steps = std::abs(double(rows.frame(i) - rows.frame(j)));
          covariance(i, j) += 1.5 * 1.5 * std::pow(0.5, steps);
          if (a.track == b.track) covariance(i, j) += 2.0 * 2.0 * std::pow(0.7, steps);
        }
      }
    }
  }
  const Whitening whitening(rows, noise, spread);
  const MatrixXd half = whitening.apply(covariance);
  const MatrixXd identity = whitening.apply(half.transpose());
  EXPECT_LT((identity - MatrixXd::Identity(rows.size(), rows.size())).cwiseAbs().maxCoeff(), 1e-9);
  // What placebo draws are made from: the covariance of whitened columns' products.
  const MatrixXd columns = whitening.apply(MatrixXd::Random(rows.size(), 4));
  const MatrixXd products = whitening.covariance_if(columns, 2);
  EXPECT_LT((products - columns.transpose() * columns).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(SolverColumns, EveryDirectionIsAColumnOfItsOwn) {
  const ThrownModel model({Vec3d(2.0, 0.5, 1.0)}, 12);
  const Rows rows(model.captures(), [](int, Index, Index) { return true; });
  Spread spread = Spread::none(rows.size());
  spread.directions = MatrixXd::Random(rows.size(), 2);
  const SolverColumns alone = solver_columns(rows, model.captures(), spread);
  EXPECT_EQ(alone.values, spread.directions);
  EXPECT_EQ(alone.member, (std::vector<int>{-1, -1}));
  spread.members = MatrixXd::Random(rows.size(), 5);
  const SolverColumns all = solver_columns(rows, model.captures(), spread);
  EXPECT_EQ(all.values.rightCols(2), spread.directions);
  ASSERT_EQ(Index(all.member.size()), all.values.cols());
  EXPECT_EQ(all.member.front(), 0);
  EXPECT_EQ(all.member.back(), -1);
  EXPECT_NEAR(spread.deviations().squaredNorm(),
              spread.members.squaredNorm() / 5.0 + spread.directions.squaredNorm(), 1e-9);
}

TEST(ScoreTest, IsWhatARefitGains) {
  // Linear least squares: T is the decrease of the sum of squares by one more column.
  const Index rows = 60;
  const MatrixXd columns = MatrixXd::Random(rows, 6);
  const VectorXd r = VectorXd::Random(rows);
  std::vector<Tested> tested(2);
  tested[0] = {{0, 0}, 0, 1, VectorXd::Constant(1, -1e9), VectorXd::Constant(1, 1e9)};
  tested[1] = {{1, 0}, 1, 2, VectorXd::Constant(2, -1e9), VectorXd::Constant(2, 1e9)};
  const VectorXd precision = VectorXd::Zero(3);
  const ScoreTest test(columns.transpose() * columns, precision, tested);
  const auto scores = test.scores(test.numerators(columns.transpose() * r, VectorXd::Zero(3)));
  const auto left = [&](const MatrixXd& x) {
    return (r - x * (x.transpose() * x).ldlt().solve(x.transpose() * r)).squaredNorm();
  };
  const double base = left(columns.leftCols(3));
  EXPECT_NEAR(scores[0].statistic, base - left(columns.leftCols(4)), 1e-10);
  MatrixXd with_two(rows, 5);
  with_two << columns.leftCols(3), columns.rightCols(2);
  EXPECT_NEAR(scores[1].statistic, base - left(with_two), 1e-10);
  EXPECT_EQ(scores[1].freedom, 2);
}

TEST(ScoreTest, APriorIsNotShrunkTwice) {
  // y = a + b with prior on a: what is left for b is what the joint posterior gives it.
  const Index rows = 30;
  MatrixXd columns = MatrixXd::Random(rows, 2);
  const VectorXd r = VectorXd::Random(rows);
  const double precision = 7.0;
  const double pull = precision * 0.4;  // Λ (θ̂ − θ₀)
  std::vector<Tested> tested{
      {{0, 0}, 0, 1, VectorXd::Constant(1, -1e9), VectorXd::Constant(1, 1e9)}};
  const ScoreTest test(columns.transpose() * columns, VectorXd::Constant(1, precision), tested);
  const auto score =
      test.scores(test.numerators(columns.transpose() * r, VectorXd::Constant(1, pull)))[0];
  MatrixXd h = columns.transpose() * columns;
  h(0, 0) += precision;
  VectorXd g = columns.transpose() * r;
  g[0] -= pull;
  const VectorXd solution = h.inverse() * g;
  EXPECT_NEAR(score.estimate[0], solution[1], 1e-10);
}

TEST(Observe, LagScaleAndShiftsAreTheirDefinitions) {
  ThrownModel model({Vec3d(2.0, 0.5, 1.0)}, 30, 2);
  model.record({}, {0.0});
  const Study study(model, 0);
  const Motion motion = *study.motions({study.fitted()})[0];
  const auto seen = [&](const std::string& name, double value) {
    const std::vector<Observed> observed{
        {&model.effects()[std::size_t(model.effect_index(name))], VectorXd::Constant(1, value)}};
    return observe(motion, model.captures(), observed);
  };
  // z(t) = z₀ + w t − ½ g t², first track, frame 10.
  const Index row = 3 * (10 * 4) + 2;
  const auto z = [](double t) { return 1.0 + t - 0.5 * 9.81 * t * t; };
  const double t = 10.0 / 30.0;
  EXPECT_NEAR(motion.positions[row], z(t), 1e-12);
  EXPECT_NEAR(seen("time_offset", 0.004)[row], z(t + 0.004), 1e-9);
  EXPECT_NEAR(seen("frame_rate", 0.02)[row], z(1.02 * t), 1e-9);
  EXPECT_NEAR(seen("scale", 0.02)[row], 1.02 * z(t), 1e-12);
  // τ ẏ = z − y from y = z₀: z − τ ż + τ² z̈ less what has not died out; z being linear between
  // frames is up to g h²/8 off.
  const double tau = 0.01;
  const double steady = z(t) - tau * (1.0 - 9.81 * t) - tau * tau * 9.81;
  EXPECT_NEAR(seen("tracker_lag", tau)[row], steady, 9.81 / (8.0 * 30.0 * 30.0));
}

TEST(Model, WhatIsNotAsDocumentedIsRefused) {
  ThrownModel model({Vec3d(2.0, 0.5, 1.0)});
  EXPECT_THROW(check(model), Error);  // nothing recorded yet
  model.record({}, {});
  EXPECT_NO_THROW(check(model));
  model.effects_[0].numbers[0].low = 1.0;
  EXPECT_THROW(check(model), Error);
}

TEST(Regions, AreNamedByTheAxesThatDivideTheBody) {
  Capture capture;
  for (int i = 0; i < 16; ++i) capture.rest.emplace_back(0.1 * i, 0.0, i % 2 ? 0.9 : 0.0);
  EXPECT_THAT(region_names(capture), testing::ElementsAre("−x −z", "+x −z", "−x +z", "+x +z"));
  const std::vector<int> regions = body_regions(capture);
  EXPECT_EQ(regions.front(), 0);
  EXPECT_EQ(regions.back(), 3);
  // A track that is never seen has no place that is known.
  capture.times = {0.0, 1.0};
  capture.rest.emplace_back(0.0, 50.0, 0.0);
  capture.use.assign(34, Use::kUsed);
  capture.use[16] = capture.use[33] = Use::kIgnored;
  EXPECT_EQ(region_names(capture).size(), 4U);
  capture.use.clear();
  capture.rest.resize(3);
  EXPECT_THAT(region_names(capture), testing::ElementsAre("all"));
}

}  // namespace
}  // namespace matterfit::diagnose
