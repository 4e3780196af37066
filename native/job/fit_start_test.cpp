// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "fit/data/capture_noise.hpp"
#include "fit/search/start.hpp"
#include "fit/search/start_limit.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fit_experiment.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/run/build_scene.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;

/// (ln μ, ln K).
Eigen::Vector2d logarithms(double youngs_modulus, double poisson_ratio) {
  return {std::log(youngs_modulus / (2.0 * (1.0 + poisson_ratio))),
          std::log(youngs_modulus / (3.0 * (1.0 - 2.0 * poisson_ratio)))};
}

/// The cube with a fit of some numbers.
Json fit_with(const std::vector<std::string>& parameters, double youngs_modulus = 3e4) {
  Json document = thrown_cube();
  document["scene"]["bodies"][0]["material"]["E"] = youngs_modulus;
  document["captures"] = {{{"tracks", "a.npz"}}};
  document["fit"] = {{"parameters", parameters}};
  return document;
}

/// A document read, with its scene and its numbers.
struct BuiltFit {
  BuiltFit(const Json& document, const fs::path& folder)
      : job(job_of(document, folder)),
        loaded(unread_experiment(job)),
        scenes{scene_of(job)},
        parameters(job.fit->parameters, loaded.experiment.runs, scenes) {}
  static mpm::Scene scene_of(const Job& job) {
    Arena arena(1);
    return build_scene(job, arena, Interrupter()).scene;
  }
  const Job job;
  const LoadedExperiment loaded;
  const std::vector<mpm::Scene> scenes;
  const fit::Parameters parameters;
};

/// Where a scan of E and ν ends that looks for `truth` (E, ν).
std::vector<double> scanned_from(double youngs_modulus, double poisson_ratio,
                                 const Eigen::Vector2d& truth) {
  Json document = fit_with({"material.nu", "material.E"}, youngs_modulus);
  document["scene"]["bodies"][0]["material"]["nu"] = poisson_ratio;
  const Folder folder;
  const BuiltFit built(document, folder.path);
  const fit::Parameters& parameters = built.parameters;
  const Eigen::Vector2d goal = logarithms(truth[0], truth[1]);
  const auto cost = [&](const std::vector<double>& values) {
    EXPECT_GE(values[0], parameters.parameters()[0].low);
    EXPECT_LE(values[0], parameters.parameters()[0].high);
    return (logarithms(values[1], values[0]) - goal).squaredNorm();
  };
  const auto costs = [&](const std::vector<std::vector<double>>& points) {
    std::vector<double> all;
    all.reserve(points.size());
    for (const auto& values : points) all.push_back(cost(values));
    return all;
  };
  const std::vector<double> start = parameters.starts();
  return fit::scanned(parameters, start, cost(start), costs).values;
}

TEST(FitStart, AScanFindsShearAndBulkApart) {
  const double half = 0.5 * std::log(10.0);
  const Eigen::Vector2d nearly_incompressible(1.5e4, 0.475);
  const std::vector<double> up = scanned_from(1e5, 0.3, nearly_incompressible);
  const Eigen::Vector2d off =
      logarithms(up[1], up[0]) - logarithms(nearly_incompressible[0], nearly_incompressible[1]);
  EXPECT_LT(off.cwiseAbs().maxCoeff(), half);
  const Eigen::Vector2d foam(2e5, 0.05);
  const std::vector<double> down = scanned_from(3e2, 0.49, foam);
  EXPECT_LT((logarithms(down[1], down[0]) - logarithms(foam[0], foam[1])).cwiseAbs().maxCoeff(),
            half);
}

TEST(FitStart, AScanLooksBothWaysWhereNothingCouldBeSimulated) {
  const double infinite = std::numeric_limits<double>::infinity();
  for (const double truth : {1e3, 1e9}) {
    const Folder folder;
    const BuiltFit built(fit_with({"material.E"}, 1e6), folder.path);
    double farthest = 0.0;
    const auto costs = [&](const std::vector<std::vector<double>>& points) {
      std::vector<double> all;
      for (const auto& values : points) {
        const double off = std::abs(std::log10(values[0] / truth));
        farthest = std::max(farthest, std::abs(std::log10(values[0] / 1e6)));
        all.push_back(off < 1.1 ? off : infinite);
      }
      return all;
    };
    EXPECT_NEAR(fit::scanned(built.parameters, {1e6}, infinite, costs, 7).values[0] / truth, 1.0,
                1e-6);
    EXPECT_LT(farthest, 3.6);
  }
}

TEST(FitStart, AScanSeesWhatLiesBehindAHill) {
  const Folder folder;
  const BuiltFit built(fit_with({"material.E"}), folder.path);
  const auto costs = [&](const std::vector<std::vector<double>>& points) {
    std::vector<double> all;
    for (const auto& values : points) {
      const double decades = std::log10(values[0] / 3e4);
      all.push_back(std::min(std::abs(decades), 1.2 - 0.1 * std::abs(decades)));
    }
    return all;
  };
  EXPECT_NEAR(fit::scanned(built.parameters, {3e6}, costs({{3e6}}).front(), costs).values[0], 3e4,
              300.0);
}

// A valley of a body's vibrations lies beside the right one, which no half decade meets.
TEST(FitStart, AFineScanSeesTheValleyBetweenHalfDecades) {
  const Folder folder;
  const BuiltFit built(fit_with({"material.E"}), folder.path);
  const auto cost = [](double modulus) {
    const double decades = std::log10(modulus / 3e4);
    return std::min(4.0 * std::abs(decades), 0.2 + 0.2 * std::abs(decades - 0.36));
  };
  const auto costs = [&](const std::vector<std::vector<double>>& points) {
    std::vector<double> all;
    all.reserve(points.size());
    for (const auto& values : points) all.push_back(cost(values[0]));
    return all;
  };
  const double start = 7e4;
  EXPECT_EQ(fit::scanned(built.parameters, {start}, cost(start), costs, 8, false).values[0], start);
  EXPECT_NEAR(fit::scanned(built.parameters, {start}, cost(start), costs, 8, true).values[0], 3e4,
              2e3);
}

/// A rigid flight of the cube's markers with (1, 2, 3) m/s; `bounce`: until the first frame only,
/// then back the way it came.
void write_flight(const fs::path& path, std::size_t frames, double noise, bool bounce) {
  const Points points = markers();
  const Vec3d velocity(1, 2, 3);
  const Vec3d gravity(0, 0, -9.81);
  std::mt19937_64 generator(5);
  std::normal_distribution<double> normal(0.0, noise);
  std::vector<double> positions;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    double t = double(frame) / 24.0;
    if (bounce && frame > 1) t = 1.0 / 24.0 - 0.7 * (t - 1.0 / 24.0);
    const Vec3d moved = t * velocity + 0.5 * t * t * gravity;
    for (const Vec3d& x : points) {
      for (int axis = 0; axis < 3; ++axis) {
        positions.push_back(x[axis] + moved[axis] + normal(generator));
      }
    }
  }
  write_tracks(path, positions, frames, 24);
}

/// The motion in captures of the folder, which are named after their files.
fit::MotionStart motion_from(const Folder& folder, const std::vector<std::string>& names,
                             double noise) {
  Json document = fit_with({"velocity", "spin"});
  document["captures"] = Json::array();
  for (const std::string& name : names) {
    document["captures"].push_back({{"tracks", name + ".npz"}, {"name", name}, {"noise", noise}});
  }
  const BuiltFit built(document, folder.path);
  std::vector<std::string> statements;
  std::vector<fit::Run> runs = load_experiment(built.job, statements).experiment.runs;
  fit::settle_noise(runs.front().captures, built.scenes.front(), statements);
  return fit::with_initial_motion(runs, built.scenes, built.parameters, built.parameters.starts());
}

TEST(FitStart, NoiseDoesNotHideAFlight) {
  for (const double noise : {1e-4, 0.02 * kSize}) {
    const Folder folder;
    write_flight(folder.path / "a.npz", 12, noise, false);
    const fit::MotionStart start = motion_from(folder, {"a"}, noise);
    EXPECT_TRUE(start.contradicted.empty());
    EXPECT_EQ(start.guesses, start.flights);
    // From all twelve frames: from two they would be known ten times worse.
    EXPECT_NEAR(start.flights[0], 1.0, noise);
    EXPECT_NEAR(start.flights[1], 2.0, noise);
    EXPECT_NEAR(start.flights[2], 3.0, noise);
  }
}

TEST(FitStart, ABounceWithinTheFirstFramesIsOnlyAGuess) {
  const Folder folder;
  write_flight(folder.path / "a.npz", 8, 1e-4, true);
  write_flight(folder.path / "b.npz", 8, 1e-4, false);
  const fit::MotionStart alone = motion_from(folder, {"a"}, 1e-4);
  EXPECT_EQ(alone.contradicted, std::vector<std::string>{"a"});
  EXPECT_EQ(alone.flights[0], 0.8);  // the document's
  EXPECT_NEAR(alone.guesses[0], 1.0, 0.01);
  // Where another recording of the body shows a flight that one counts, whichever comes first.
  for (const auto& names : {std::vector<std::string>{"a", "b"}, {"b", "a"}}) {
    const fit::MotionStart both = motion_from(folder, names, 1e-4);
    EXPECT_TRUE(both.contradicted.empty());
    EXPECT_NEAR(both.flights[0], 1.0, 0.01);
    EXPECT_EQ(both.guesses, both.flights);
  }
}

TEST(FitStart, TheStiffestIsWhatCanBeSimulated) {
  const auto most_of = [](double start) {
    const Folder folder;
    record(thrown_cube(), folder.path, "a", 1);
    const BuiltFit built(fit_with({"material.E", "material.nu", "velocity"}, start), folder.path);
    std::vector<std::string> statements;
    const std::vector<fit::Run> runs = load_experiment(built.job, statements).experiment.runs;
    const fit::StartLimit limit(runs, built.scenes, built.parameters);
    std::vector<double> values = built.parameters.starts();
    EXPECT_TRUE(limit.allows(values));
    EXPECT_EQ(limit.softened(values), values);
    values[0] = 1e10;
    EXPECT_FALSE(limit.allows(values));
    const std::vector<double> softer = limit.softened(values);
    EXPECT_EQ(std::vector(softer.begin() + 1, softer.end()),
              std::vector(values.begin() + 1, values.end()));
    values[0] = 0.99 * softer[0];
    EXPECT_TRUE(limit.allows(values));
    values[0] = 1.5 * softer[0];
    EXPECT_FALSE(limit.allows(values));
    return softer[0];
  };
  // 300 substeps a frame of cells of 10 cm: far above what it is to find.
  EXPECT_GT(most_of(3e4), 3e7);
  // A hundred times a stiff start.
  EXPECT_NEAR(most_of(5e7) / 5e9, 1.0, 0.2);
}

}  // namespace
}  // namespace matterfit::job
