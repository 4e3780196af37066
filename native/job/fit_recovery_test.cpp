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

/// Of the fixture's cube, of another material and thrown down at `speed` [m/s].
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

}  // namespace
}  // namespace matterfit::job
