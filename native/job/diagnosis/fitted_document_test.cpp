// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/fitted_document.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "job/fit_fixture_for_test.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;

/// A thrown cube, and two recordings of another one whose material is another.
Job job_of_three() {
  Json document = thrown_cube();
  document["task"] = "diagnose";
  const Json own = {{"bodies", {{{"name", "cube"}, {"material", {{"E", 4e4}}}}}}};
  document["captures"] = {{{"tracks", "a.npz"}},
                          {{"tracks", "b.npz"}, {"scene", own}},
                          {{"tracks", "c.npz"}, {"scene", own}}};
  document["fit"] = {
      {"parameters",
       {{{"path", "velocity"}, {"prior", {{"mean", {1.0, 2.0, 3.0}}, {"sigma", 0.5}}}},
        "material.E",
        "captures.b.material.E"}}};
  return job_of(document, {});
}

Json estimate(const std::string& path, double start, double low, double high, bool observable) {
  return {{"path", path}, {"start", start}, {"bounds", {low, high}}, {"observable", observable}};
}

/// Ended with both materials known, or that of the other cube not.
Fitted fitted_of(const Job& job, bool known) {
  Fitted fitted;
  fitted.document = document_to_simulate(job, "out");
  fitted.fit["parameters"] = {estimate("bodies.cube.velocity[0]", 0.0, -50.0, 50.0, true),
                              estimate("bodies.cube.velocity[1]", 0.0, -50.0, 50.0, true),
                              estimate("bodies.cube.velocity[2]", 0.0, -50.0, 50.0, true),
                              estimate("bodies.cube.material.E", 1e5, 1e2, 1e10, true),
                              estimate("captures.b.bodies.cube.material.E", 1e5, 1e2, 1e10, known)};
  return fitted;
}

TEST(FittedDocument, KeepsThePriorsOfAFit) {
  const Job job = job_of_three();
  std::vector<std::string> statements;
  const Json document = document_to_diagnose(job, fitted_of(job, true), statements);
  EXPECT_TRUE(statements.empty());
  const Json& parameters = document.at("fit").at("parameters");
  ASSERT_EQ(parameters.size(), 5U);
  // A vector's, component by component.
  EXPECT_EQ(parameters[1].at("prior"), (Json{{"mean", 2.0}, {"sigma", 0.5}}));
  EXPECT_FALSE(parameters[3].contains("prior"));
  EXPECT_EQ(document.at("captures"), job.document.at("captures"));
}

TEST(FittedDocument, WhatIsNotIdentifiedBeginsAgain) {
  const Job job = job_of_three();
  std::vector<std::string> statements;
  const Json document = document_to_diagnose(job, fitted_of(job, false), statements);
  EXPECT_THAT(statements, testing::ElementsAre(testing::HasSubstr("does not identify")));
  const Json& parameters = document.at("fit").at("parameters");
  EXPECT_EQ(parameters[3].at("bounds"), (Json{1e2, 1e10}));
  EXPECT_EQ(parameters[4].at("bounds"), (Json{1e5 / 30.0, 1e5 * 30.0}));
  // In both recordings of that cube and not in the first one's.
  const auto modulus = [](const Json& scene) { return scene["bodies"][0]["material"]["E"]; };
  EXPECT_EQ(modulus(document["scene"]), 3e4);
  EXPECT_EQ(modulus(document["captures"][1]["scene"]), 1e5);
  EXPECT_EQ(modulus(document["captures"][2]["scene"]), 1e5);
}

}  // namespace
}  // namespace matterfit::job
