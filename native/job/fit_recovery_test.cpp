// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "job/fit_fixture_for_test.hpp"

/// Known parameters in noisy tracks (Gaussian, .2 % of the body's size): every seed must find them.
namespace matterfit::job {
namespace {

using namespace fit_test;

struct Wanted {
  std::string path;
  double truth = 0.0;
  double start = 0.0;
  double tolerance = 0.0;
  bool relative = true;
};

/// A fit of the fixture's cube, of another material and thrown down at `speed` [m/s].
void recovers(const Json& material, double speed, const std::vector<Wanted>& wanted) {
  Json truth = thrown_cube();
  truth["scene"]["bodies"][0]["material"] = material;
  truth["scene"]["bodies"][0]["velocity"] = {0.8, 0.3, -speed};
  for (const unsigned seed : {1U, 2U, 3U}) {
    const Folder folder;
    record(truth, folder.path, "a", seed);
    std::vector<std::string> parameters;
    Json document = truth;
    for (const Wanted& one : wanted) {
      parameters.push_back("material." + one.path);
      document["scene"]["bodies"][0]["material"][one.path] = one.start;
    }
    document = fit_of(document, parameters);
    document["fit"]["levels"] = {1};
    const Json result = run(document, folder.path);
    for (const Wanted& one : wanted) {
      const double value = value_of(result, "bodies.cube.material." + one.path);
      const double error = (value - one.truth) / (one.relative ? one.truth : 1.0);
      EXPECT_LT(std::abs(error), one.tolerance)
          << one.path << " is " << value << ", seed " << seed << ": " << result["fit"]["reason"];
    }
  }
}

TEST(FitRecovers, StiffnessAndPoissonsRatio) {
  recovers({{"law", "neo_hookean"}, {"E", 3e4}, {"nu", 0.3}}, 1.5,
           {{"E", 3e4, 1e5, 0.02}, {"nu", 0.3, 0.4, 0.02, false}});
}

TEST(FitRecovers, TheYieldStress) {
  recovers({{"law", "von_mises"}, {"E", 1e5}, {"nu", 0.3}, {"yield_stress", 2e3}}, 2.5,
           {{"yield_stress", 2e3, 8e3, 0.05}});
}

TEST(FitRecovers, YieldStressAndViscosityOfABinghamFluid) {
  recovers({{"law", "herschel_bulkley"},
            {"E", 1e5},
            {"nu", 0.3},
            {"yield_stress", 500},
            {"viscosity", 30}},
           2.5, {{"yield_stress", 500, 1500, 0.05}, {"viscosity", 30, 100, 0.05}});
}

TEST(FitRecovers, TheViscosityOfAFluid) {
  recovers({{"law", "newtonian"}, {"bulk_modulus", 1e5}, {"viscosity", 50}}, 2.5,
           {{"viscosity", 50, 10, 0.05}});
}

TEST(FitRecovers, TheFrictionAngle) {
  recovers({{"law", "drucker_prager"}, {"E", 1e5}, {"nu", 0.3}, {"friction_angle", 30}}, 2.5,
           {{"friction_angle", 30, 42, 1.0, false}});
}

/// A bootstrap: the fit repeated on other noise scatters as its standard errors say.
TEST(FitErrors, AgreeWithABootstrap) {
  constexpr unsigned kSamples = 16;
  Json truth = thrown_cube();
  truth["scene"]["frames"] = {0, 10};
  Json document = fit_of(truth, {"material.E", "material.nu"});
  document["fit"]["levels"] = {1};
  document["fit"]["windows"] = false;
  const std::vector<std::string> paths = {"bodies.cube.material.E", "bodies.cube.material.nu"};
  std::vector<std::vector<double>> values(paths.size());
  std::vector<double> stated(paths.size(), 0.0);
  for (unsigned seed = 1; seed <= kSamples; ++seed) {
    const Folder folder;
    record(truth, folder.path, "a", seed);
    const Json result = run(document, folder.path);
    for (std::size_t k = 0; k < paths.size(); ++k) {
      const Json& found = result["fit"]["parameters"][k];
      EXPECT_EQ(found["path"], paths[k]);
      values[k].push_back(found["value"].get<double>());
      stated[k] += std::pow(found["standard_error"].get<double>(), 2.0) / kSamples;
    }
  }
  for (std::size_t k = 0; k < paths.size(); ++k) {
    double mean = 0.0;
    for (const double value : values[k]) mean += value / kSamples;
    double variance = 0.0;
    for (const double value : values[k]) variance += std::pow(value - mean, 2.0) / (kSamples - 1);
    const double ratio = std::sqrt(stated[k] / variance);
    RecordProperty(paths[k], std::to_string(ratio));
    EXPECT_GT(ratio, 0.6) << paths[k];
    EXPECT_LT(ratio, 1.8) << paths[k];
  }
}

}  // namespace
}  // namespace matterfit::job
