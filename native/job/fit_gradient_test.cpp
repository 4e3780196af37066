// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "fit/data/follow.hpp"
#include "fit/model/capture_problem.hpp"
#include "fit/model/gradient_chain.hpp"
#include "fit/model/predictor.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fit_experiment.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/fourth_order_for_test.hpp"
#include "mpm/default_stiffness.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;

/// A fit of tracks made anew of a document, as a problem of its own.
class Fixture {
 public:
  explicit Fixture(const Json& document, const fs::path& folder, int threads = 2)
      : job_(job_of(document, folder)),
        loaded_(prepare_experiment(job_, 1, interrupter_, statements_)),
        predictor_(loaded_.experiment, job_.fit->parameters, {.threads = threads}, interrupter_) {
    const std::vector<fit::Run>& runs = predictor_.runs();
    const fit::Window window = fit::growing_windows(runs, false).front();
    const std::vector<std::vector<double>> start{parameters().starts()};
    const fit::Evaluation found = predictor_.model().evaluate(start, {window.until});
    problem_ =
        std::make_unique<fit::CaptureProblem>(predictor_.model(), runs, parameters().parameters(),
                                              fit::Loss::kTracks, window, fit::used_samples(runs));
    problem_->set_plan(predictor_.model().plan_of(start.front(), *found.outcomes.front()));
  }

  [[nodiscard]] fit::CaptureProblem& problem() { return *problem_; }
  [[nodiscard]] const mpm::Scene& scene() const { return predictor_.scenes().front(); }
  [[nodiscard]] const fit::Parameters& parameters() const { return predictor_.parameters(); }
  [[nodiscard]] Eigen::VectorXd start() const {
    Eigen::VectorXd point(Eigen::Index(parameters().size()));
    for (std::size_t k = 0; k < parameters().size(); ++k) {
      const fit::Parameter& parameter = parameters().parameters()[k];
      point[Eigen::Index(k)] = fit::to_natural(parameter.coordinate, parameter.start);
    }
    return point;
  }

 private:
  Interrupter interrupter_;
  std::vector<std::string> statements_;
  Job job_;
  LoadedExperiment loaded_;
  fit::Predictor predictor_;
  std::unique_ptr<fit::CaptureProblem> problem_;
};

/// What the residuals are weighed by: smooth over the points, so that no rounding of one counts.
Eigen::VectorXd some_weights(Eigen::Index size) {
  Eigen::VectorXd weights(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    weights[i] = std::sin(0.37 * double(i)) + 0.5 * std::cos(0.011 * double(i));
  }
  return weights;
}

/// Jᵀw against differences of fourth order of the same simulations. Those are in float, and contact
/// makes of its rounding a noise of about kGradientNoise in wᵀr, and kinks in it: some hundredths.
/// Exact to 1e-6 are the proofs of mpm::gradient; here it is about the chain from there to the
/// numbers.
constexpr double kGradientNoise = 0.02;
void expect_transposed(const Json& document, const fs::path& folder, double step) {
  Fixture fixture(document, folder);
  fit::CaptureProblem& problem = fixture.problem();
  ASSERT_GT(problem.transposed_cost(), 0.0);
  const Eigen::VectorXd start = fixture.start();
  const auto n = std::size_t(start.size());
  Eigen::VectorXd steps(start.size());
  for (std::size_t k = 0; k < n; ++k) {
    steps[Eigen::Index(k)] = step * fixture.parameters().parameters()[k].scale;
  }
  const auto results = problem.evaluate(points_about(start, steps));
  for (const auto& result : results) ASSERT_TRUE(result.has_value());
  const Eigen::VectorXd weights = some_weights(results[0]->size());
  const auto exact = problem.transposed(start, weights);
  ASSERT_TRUE(exact.has_value());
  const Eigen::VectorXd slopes = slopes_of(results, weights, steps);
  for (std::size_t k = 0; k < n; ++k) {
    const double h = steps[Eigen::Index(k)];
    const double difference = slopes[Eigen::Index(k)];
    const std::string& name = fixture.parameters().parameters()[k].name;
    EXPECT_GT(std::abs(difference), 5.0 * kGradientNoise / h) << name;
    EXPECT_NEAR((*exact)[Eigen::Index(k)], difference,
                6e-2 * std::abs(difference) + kGradientNoise / h)
        << name;
  }
}

TEST(FitGradient, IsTheTransposeOfDifferencesForElasticBodies) {
  const Folder folder;
  Json truth = thrown_cube();
  truth["scene"]["frames"] = {0, 6};
  truth["scene"]["bodies"][0]["material"]["damping_shear"] = 50.0;
  truth["scene"]["bodies"][0]["spin"] = {1, -2, 3};
  truth["scene"]["colliders"][0]["contact"]["mu"] = 0.2;
  truth["scene"]["bodies"][0]["material"]["maxwell"] = {{{"modulus", 5e3}, {"time", 0.05}}};
  record(truth, folder.path, "a", 1);
  // Between frames and beside them; the last sample lies between the last two frames.
  Json document =
      fit_of(truth, {"material.E", "material.nu", "material.damping_shear",
                     "material.maxwell[0].modulus", "material.maxwell[0].time", "density",
                     "velocity", "spin", "gravity", "colliders.ground.contact.mu",
                     "colliders.ground.contact.stiffness", "colliders.ground.height"});
  document["captures"][0]["start_frame"] = 0.3;
  document["captures"][0]["positions"] = Json::array();
  for (const Vec3d& x : markers()) {
    document["captures"][0]["positions"].push_back({x.x(), x.y(), x.z()});
  }
  expect_transposed(document, folder.path, 0.03);
}

TEST(FitGradient, IsTheTransposeOfDifferencesForPlasticBodies) {
  for (const char* formulation : {"updated", "renewed"}) {
    const Folder folder;
    Json truth = thrown_cube();
    truth["scene"]["frames"] = {0, 6};
    truth["scene"]["bodies"][0]["formulation"] = formulation;
    truth["scene"]["bodies"][0]["material"] = {
        {"law", "von_mises"}, {"E", 3e4}, {"nu", 0.3}, {"yield_stress", 800}, {"hardening", 2e3}};
    record(truth, folder.path, "a", 1);
    SCOPED_TRACE(formulation);
    expect_transposed(fit_of(truth, {"material.E", "material.nu", "material.yield_stress",
                                     "material.hardening", "velocity", "spin"}),
                      folder.path, 0.03);
  }
}

TEST(FitGradient, GoesThroughContactsThatFollowTheMaterial) {
  const Folder folder;
  Json truth = thrown_cube();
  truth["scene"]["frames"] = {0, 6};
  record(truth, folder.path, "a", 1);
  Json document = fit_of(truth, {"material.E", "material.nu"});
  document["scene"]["colliders"][0]["contact"].erase("stiffness");
  expect_transposed(document, folder.path, 0.03);
  // The contact's part is not small, so the test above would see that it is missing.
  Fixture follows(document, folder.path);
  const mpm::Scene& scene = follows.scene();
  document["scene"]["colliders"][0]["contact"]["stiffness"] =
      mpm::contact_stiffnesses(scene, scene.bodies.front()).front();
  Fixture held(document, folder.path);
  const Eigen::VectorXd start = follows.start();
  const auto residual = follows.problem().evaluate({start}).front();
  ASSERT_TRUE(residual.has_value());
  const Eigen::VectorXd weights = some_weights(residual->size());
  const Eigen::VectorXd with = *follows.problem().transposed(start, weights);
  const Eigen::VectorXd without = *held.problem().transposed(start, weights);
  EXPECT_GT(((with - without).array() / with.array()).abs().maxCoeff(), 0.1)
      << with.transpose() << "; " << without.transpose();
}

TEST(FitGradient, SameBitsForAnyThreads) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  const Json document = fit_of(thrown_cube(), {"material.E", "velocity"});
  Fixture one(document, folder.path, 1);
  Fixture two(document, folder.path, 2);
  const Eigen::VectorXd point = one.start();
  const auto residual = one.problem().evaluate({point}).front();
  ASSERT_TRUE(residual.has_value());
  EXPECT_EQ(one.problem().transposed(point, *residual), two.problem().transposed(point, *residual));
}

TEST(FitGradient, IsNotThereForWhatItDoesNotKnow) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  for (const char* unknown :
       {"placement.position", "placement.rotation", "captures.a.start_frame"}) {
    Fixture fixture(fit_of(thrown_cube(), {"material.E", unknown}), folder.path);
    EXPECT_EQ(fixture.problem().transposed_cost(), 0.0) << unknown;
    EXPECT_FALSE(fixture.problem().transposed(fixture.start(), {}).has_value()) << unknown;
  }
}

TEST(FitGradient, TimesBetweenFramesAreTransposed) {
  std::mt19937 engine(3);
  std::normal_distribution<double> normal;
  const auto random = [&](std::size_t count) {
    Points points(count);
    for (Vec3d& x : points) {
      for (int a = 0; a < 3; ++a) x[a] = normal(engine);
    }
    return points;
  };
  constexpr std::size_t kFrames = 5;
  constexpr std::size_t kPoints = 2;
  const double fps = 10.0;
  const std::vector<double> times{-0.1, 0.0, 0.03, 0.1, 0.17, 0.25, 0.39, 0.4, 0.5};
  std::vector<Points> frames;
  for (std::size_t f = 0; f < kFrames; ++f) frames.push_back(random(kPoints));
  const Points bar = random(times.size() * kPoints);
  const fit::SimulatedCapture seen = fit::at_times(frames, kPoints, times, fps);
  EXPECT_EQ(seen.outside, 2U);
  double forth = 0.0;
  for (std::size_t i = 0; i < bar.size(); ++i) {
    if (seen.positions[i].allFinite()) forth += bar[i].dot(seen.positions[i]);
  }
  const std::vector<Points> back = fit::frames_bar(kFrames, kPoints, times, fps, bar);
  double sum = 0.0;
  for (std::size_t f = 0; f < kFrames; ++f) {
    for (std::size_t i = 0; i < kPoints; ++i) sum += back[f][i].dot(frames[f][i]);
  }
  EXPECT_NEAR(sum, forth, 1e-13 * std::abs(forth) + 1e-13);
}

}  // namespace
}  // namespace matterfit::job
