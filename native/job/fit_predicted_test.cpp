// SPDX-License-Identifier: GPL-3.0-or-later
// How sure a fit's prediction is: a throw that it did not see lies within the band.
#include "job/fit_predicted.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "job/fit_fixture_for_test.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;

TEST(FitPredicted, DrawsHaveTheErrorsAndCorrelationsOfTheFit) {
  std::vector<fit::Parameter> parameters(3);
  parameters[0].coordinate = fit::Coordinate::kLog;
  parameters[0].low = 1.0;
  parameters[0].high = 1e9;
  for (std::size_t k : {1, 2}) {
    parameters[k].low = -10.0;
    parameters[k].high = 10.0;
  }
  const std::vector<double> values{1e5, 2.0, 3.0};
  fit::Uncertainty known;
  known.estimates.resize(3);
  known.estimates[0].standard_error = 0.03 * 1e5;
  known.estimates[0].grid_error = 0.04 * 1e5;
  known.estimates[1].standard_error = 0.1;
  known.estimates[2].standard_error = std::numeric_limits<double>::infinity();
  known.correlation = Eigen::MatrixXd::Identity(3, 3);
  known.correlation(0, 1) = known.correlation(1, 0) = -0.8;
  const auto sets = drawn_values(parameters, values, known, 16, 3);
  ASSERT_EQ(sets.size(), 16U);
  double of_e = 0.0;
  double of_v = 0.0;
  double both = 0.0;
  for (const std::vector<double>& set : sets) {
    const double e = std::log(set[0] / 1e5);
    const double v = set[1] - 2.0;
    of_e += e * e / 16.0;
    of_v += v * v / 16.0;
    both += e * v / 16.0;
    EXPECT_EQ(set[2], 3.0);
  }
  // Both errors of E: 5 %.
  EXPECT_NEAR(std::sqrt(of_e), 0.05, 1e-9);
  EXPECT_NEAR(std::sqrt(of_v), 0.1, 1e-9);
  EXPECT_NEAR(both / std::sqrt(of_e * of_v), -0.8, 1e-9);
  EXPECT_EQ(drawn_values(parameters, values, known, 16, 3), sets);
  parameters[1].high = 2.01;
  for (const auto& set : drawn_values(parameters, values, known, 16, 3)) EXPECT_LE(set[1], 2.01);
}

TEST(FitPredicted, AThrowThatTheFitDidNotSeeLiesWithinTheBand) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  Json other = thrown_cube();
  other["scene"]["bodies"][0]["velocity"] = {-0.5, 0, -2.0};
  record(other, folder.path, "b", 2);
  Json document = fit_of(thrown_cube(), {"material.E", "material.nu"});
  document["scene"]["bodies"][0]["material"]["E"] = 6e4;
  document["captures"].push_back(
      {{"tracks", "b.npz"},
       {"noise", 8e-4},
       {"holdout", {{"capture", true}}},
       {"scene", {{"bodies", {{{"name", "cube"}, {"velocity", {-0.5, 0, -2.0}}}}}}}});
  document["fit"]["draws"] = 16;
  const Json result = run(document, folder.path);
  const Json& predicted = result["fit"]["predicted"];
  ASSERT_TRUE(predicted.is_object()) << result["fit"].dump(1);
  RecordProperty("predicted", predicted.dump());
  EXPECT_EQ(predicted["draws"], 16);
  EXPECT_EQ(predicted["too_dear"], 0);
  ASSERT_EQ(predicted["captures"].size(), 1U);
  EXPECT_EQ(predicted["captures"][0]["name"], "b");
  EXPECT_EQ(predicted["samples"], 13 * 64);
  EXPECT_GE(predicted["coverage"].get<double>(), 0.8);
  EXPECT_LE(predicted["coverage"].get<double>(), 1.0);
  // It says something: the band is narrower than the body's side is long by far, and not nothing.
  EXPECT_GT(predicted["half_width_mm"].get<double>(), 0.01);
  EXPECT_LT(predicted["half_width_mm"].get<double>(), 40.0);
  document["fit"].erase("draws");
  const Json without = run(document, folder.path, 2, Restart::kAlways);
  EXPECT_FALSE(without["fit"].contains("predicted"));
  EXPECT_EQ(without["fit"]["parameters"], result["fit"]["parameters"]);
}

/// With noise of five times the body E is known to a factor of several: what would take many times
/// the substeps is left out, and said.
TEST(FitPredicted, DrawsThatAreTooDearAreLeftOutAndCounted) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  Json document = fit_of(thrown_cube(), {"material.E"});
  document["captures"][0]["noise"] = 2.0;
  document["captures"][0]["holdout"] = {{"frames", {9, 14}}};
  document["fit"]["draws"] = 32;
  const Json result = run(document, folder.path);
  const Json& predicted = result["fit"]["predicted"];
  ASSERT_TRUE(predicted.is_object()) << result["fit"].dump(1);
  EXPECT_GE(predicted["too_dear"].get<int>(), 2);
  EXPECT_LE(predicted["draws"].get<int>() + predicted["too_dear"].get<int>(), 32);
}

}  // namespace
}  // namespace matterfit::job
