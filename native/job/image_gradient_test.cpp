// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "job/clip_for_test.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fourth_order_for_test.hpp"
#include "job/image_experiment.hpp"
#include "job/splat_ball_for_test.hpp"

/// The transpose of how images change with a fit's numbers.
namespace matterfit::job {
namespace {

using namespace fit_test;

constexpr double kBlur = 2.0;

/// A fit to images made anew of a document, as a problem of its own.
class ImageFixture {
 public:
  ImageFixture(const Json& document, const fs::path& folder, int threads = 2)
      : job_(job_of(document, folder)) {
    options_.threads = threads;
    experiment_.emplace(job_, fit_of(job_), options_, interrupter_, statements_);
    const std::vector<double> values = experiment_->parameters().starts();
    experiment_->settle_steps(values);
    experiment_->settle_sizes(values);
    (void)experiment_->learn_colours(values);
    problem_.emplace(experiment_->problem(values, kBlur));
  }
  [[nodiscard]] fit::ImageProblem& problem() { return *problem_; }
  [[nodiscard]] const fit::Parameter& parameter(std::size_t k) const {
    return experiment_->parameters().parameters()[k];
  }
  [[nodiscard]] Eigen::VectorXd start() const {
    const std::vector<double> values = experiment_->parameters().starts();
    Eigen::VectorXd point(Eigen::Index(values.size()));
    for (std::size_t k = 0; k < values.size(); ++k) {
      point[Eigen::Index(k)] = fit::to_natural(parameter(k).coordinate, values[k]);
    }
    return point;
  }

 private:
  Job job_;
  RunOptions options_;
  Interrupter interrupter_;
  std::vector<std::string> statements_;
  std::optional<ImageExperiment> experiment_;
  std::optional<fit::ImageProblem> problem_;
};

/// The cube's first frames, by two cameras.
void film_frames(int end, const fs::path& folder) {
  Json truth = filmed_cube();
  truth["scene"]["frames"] = {0, end};
  film(truth, folder, two_cameras());
}

Json image_fit_of(const std::vector<std::string>& parameters) {
  Json document = thrown_cube();
  document["scene"]["frames"] = {0, 6};
  document["task"] = "fit";
  document["scene"]["bodies"][0]["velocity"] = {0.6, 0.4, -2.5};
  document["scene"]["bodies"][0]["spin"] = {1, -2, 3};
  document["captures"] = Json::array({{{"cameras", "clip/transforms.json"}, {"noise", 0.3}}});
  document["fit"] = {{"parameters", parameters}};
  return document;
}

/// rᵀJ against differences of ½ r², by the residual itself: what a descent goes by. Those are of
/// float images, in which a Gaussian ends where its α falls below 1/255; the way back holds that
/// edge, which is a few percent where a body's shape changes and not its place. So each number is
/// to be right beside the largest, in steps as a search takes them.
void expect_descent(const Json& document, const fs::path& folder, double step, double tolerance) {
  ImageFixture fixture(document, folder);
  fit::ImageProblem& problem = fixture.problem();
  ASSERT_GT(problem.transposed_cost(), 0.0);
  const Eigen::VectorXd start = fixture.start();
  const auto n = std::size_t(start.size());
  Eigen::VectorXd scales(start.size());
  for (std::size_t k = 0; k < n; ++k) scales[Eigen::Index(k)] = fixture.parameter(k).scale;
  const auto results = problem.evaluate(points_about(start, step * scales));
  for (const auto& result : results) ASSERT_TRUE(result.has_value()) << problem.failure();
  const Eigen::VectorXd& weights = *results[0];
  const auto exact = problem.transposed(start, weights);
  ASSERT_TRUE(exact.has_value());
  const Eigen::VectorXd difference = slopes_of(results, weights, step * scales);
  const double largest = difference.cwiseProduct(scales).cwiseAbs().maxCoeff();
  EXPECT_GT(largest, 0.0);
  for (std::size_t k = 0; k < n; ++k) {
    const auto at = Eigen::Index(k);
    EXPECT_NEAR((*exact)[at] * scales[at], difference[at] * scales[at], tolerance * largest)
        << fixture.parameter(k).name;
  }
}

TEST(ImageGradient, IsTheTransposeOfDifferencesForMasks) {
  const Folder folder;
  film_frames(6, folder.path);
  Json document = image_fit_of({"material.E", "material.nu", "density", "velocity", "spin"});
  // Between frames, images that are drawn finer than they are compared, and a ground before them.
  document["captures"][0]["start_frame"] = 0.3;
  expect_descent(document, folder.path, 0.02, 5e-2);
}

/// One of two bodies, behind the other in places, and what is painted on it.
TEST(ImageGradient, IsTheTransposeOfDifferencesForColoursOfOneOfTwoBodies) {
  const Folder folder;
  Json truth = filmed_cube();
  truth["scene"]["frames"] = {0, 5};
  truth["scene"]["bodies"].push_back(
      Json::parse(R"({ "name": "ball", "density": 800, "velocity": [0, 0, 0.5],
        "source": { "sphere": { "center": [0.5, -0.45, 0.35], "radius": 0.15 } },
        "formulation": "updated", "material": { "law": "neo_hookean", "E": 2e4, "nu": 0.3 } })"));
  truth["scene"]["bodies"][0]["formulation"] = "updated";
  film(truth, folder.path, two_cameras(), [](const auto& scene, const auto& state, const auto& at) {
    return paint(scene, state, at, [](const Vec3d& rest) {
      return Vec3d(0.5 + 0.4 * std::sin(9.0 * rest.x()), 0.5 + 0.4 * std::cos(7.0 * rest.y()),
                   0.3 + rest.z());
    });
  });
  Json document =
      image_fit_of({"bodies.cube.material.E", "bodies.cube.velocity", "bodies.cube.spin"});
  document["scene"]["frames"] = {0, 5};
  document["scene"]["bodies"][0]["formulation"] = "updated";
  document["scene"]["bodies"].push_back(truth["scene"]["bodies"][1]);
  document["captures"][0]["colours"] = {{"noise", 0.05}};
  expect_descent(document, folder.path, 0.02, 6e-2);
}

TEST(ImageGradient, SameBitsForAnyThreads) {
  const Folder folder;
  film_frames(4, folder.path);
  Json document = image_fit_of({"material.E", "velocity"});
  document["scene"]["frames"] = {0, 4};
  std::optional<Eigen::VectorXd> first;
  for (const int threads : {1, 2, 8}) {
    ImageFixture fixture(document, folder.path, threads);
    const auto residual = fixture.problem().evaluate({fixture.start()}).front();
    ASSERT_TRUE(residual.has_value());
    const auto found = fixture.problem().transposed(fixture.start(), *residual);
    ASSERT_TRUE(found.has_value());
    if (!first) first = found;
    EXPECT_EQ(*first, *found) << threads;
  }
}

/// By splats that a body carries, their colours among them.
TEST(ImageGradient, IsTheTransposeOfDifferencesForSplatsOfABodysOwn) {
  const Folder folder;
  (void)film_ball(folder.path);
  Json document = fit_to_splats();
  document["scene"]["frames"] = {0, 6};
  document["captures"][0].erase("holdout");
  document["scene"]["bodies"][0]["velocity"] = {0.3, 0.0, 0.05};
  document["fit"]["parameters"] = {"material.E", "velocity", "spin"};
  // An outline here is where the tails of many thin Gaussians end, a tenth of the whole slope.
  expect_descent(document, folder.path, 0.05, 0.12);
}

/// Poses of cameras beside what moves the body.
TEST(ImageGradient, IsTheTransposeOfDifferencesForPoses) {
  const Folder folder;
  film_frames(5, folder.path);
  Json document = image_fit_of({"material.E", "velocity", "captures.clip.poses[1].shift",
                                "captures.clip.poses[1].turn", "captures.clip.poses[0].turn[2]"});
  document["scene"]["frames"] = {0, 5};
  expect_descent(document, folder.path, 0.02, 6e-2);
}

/// A lens has none.
TEST(ImageGradient, IsNotThereForWhatItDoesNotKnow) {
  const Folder folder;
  film_frames(3, folder.path);
  Json document = image_fit_of({"material.E", "captures.clip.poses[0].focal"});
  document["scene"]["frames"] = {0, 3};
  ImageFixture fixture(document, folder.path);
  EXPECT_EQ(fixture.problem().transposed_cost(), 0.0);
  EXPECT_FALSE(fixture.problem().transposed(fixture.start(), {}).has_value());
}

}  // namespace
}  // namespace matterfit::job
