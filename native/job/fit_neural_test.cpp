// SPDX-License-Identifier: GPL-3.0-or-later
// Fits with the isotropic neural law: a flow whose class is not said, what the result is like, and
// all weights of the energy.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "base/file.hpp"
#include "base/message_for_test.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/fit_like.hpp"
#include "job/pretrain_files.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using testing::HasSubstr;

/// A clip of the fixture's cube of another material, thrown down, and a fit that begins with jelly.
struct Clip {
  Clip(const Json& material, double speed, const std::vector<std::string>& parameters) {
    Json truth = thrown_cube();
    truth["scene"]["bodies"][0]["material"] = material;
    truth["scene"]["bodies"][0]["velocity"] = {0.8, 0.3, -speed};
    truth["scene"]["bodies"][0]["formulation"] = "updated";
    record(truth, folder.path, "a", 1);
    document = fit_of(truth, parameters);
    document["scene"]["bodies"][0]["material"] = {{"law", "neural_isotropic"},
                                                  {"weights", "jelly"}};
    document["fit"]["levels"] = {1};
    document["captures"][0]["holdout"] = {{"frames", {11, 14}}};
  }
  Json run() { return fit_test::run(document, folder.path); }

  Folder folder;
  Json document;
};

double mean(const Json& result, const char* when, const char* what) {
  return result["fit"][when][what]["mean_mm"].get<double>();
}

/// The test's figures, of --gtest_output.
void record_property(const Json& result) {
  testing::Test::RecordProperty(
      "summary", std::to_string(mean(result, "before", "held_out")) + " mm held out, then " +
                     std::to_string(mean(result, "after", "held_out")) + "; " +
                     result["fit"]["like"]["cube"]["sentence"].get<std::string>());
}

const std::vector<std::string> kFlow = {"material.E",
                                        "material.nu",
                                        "material.yield_strain",
                                        "material.internal_friction",
                                        "material.tear_strain",
                                        "material.flow_rate"};

TEST(FitNeural, FindsPlasticineWithoutBeingToldThatItYields) {
  Clip clip({{"law", "von_mises"}, {"E", 1e5}, {"nu", 0.3}, {"yield_stress", 2e3}}, 2.5, kFlow);
  const Json result = clip.run();
  record_property(result);
  EXPECT_LT(mean(result, "after", "held_out"), 0.1 * mean(result, "before", "held_out"));
  const Json& like = result["fit"]["like"]["cube"];
  EXPECT_NEAR(like["parameters"].value("yield_stress", 0.0), 2e3, 0.1 * 2e3) << like;
  EXPECT_LT(like["distance"].get<double>(), 0.2) << like;
  EXPECT_THAT(result["fit"]["statements"].dump(), HasSubstr("Looked for as each class of flow"));
}

TEST(FitNeural, FindsAFluidWithoutBeingToldThatItFlows) {
  Clip clip({{"law", "newtonian"}, {"bulk_modulus", 1e5}, {"viscosity", 50}}, 2.5, kFlow);
  const Json result = clip.run();
  record_property(result);
  EXPECT_LT(mean(result, "after", "held_out"), 0.2 * mean(result, "before", "held_out"));
  const Json& like = result["fit"]["like"]["cube"];
  EXPECT_NEAR(like["parameters"].value("viscosity", 0.0), 50.0, 0.2 * 50.0) << like;
}

TEST(FitNeural, AllWeightsAreTakenOnlyWhereTheyPredictBetter) {
  Clip clip({{"law", "neo_hookean"}, {"E", 3e4}, {"nu", 0.4}}, 1.5,
            {"material.E", "material.nu", "material.form_1", "material.form_2"});
  clip.document["fit"]["weights"] = 8;
  const Json result = clip.run();
  record_property(result);
  const Json& weights = result["fit"]["weights"];
  const double without = weights["held_out_mm"]["without"].get<double>();
  EXPECT_LE(weights["held_out_mm"]["with"].get<double>(), without);
  EXPECT_TRUE(weights["taken"].get<bool>()) << weights;
  // The error of the run that follows, which has substeps of its own.
  EXPECT_LT(mean(result, "after", "held_out"), 1.05 * without);
  const auto written = read_file(clip.folder.path / "out/scene.json");
  const Json scene =
      Json::parse(std::string(reinterpret_cast<const char*>(written.data()), written.size()));
  const Json& material = scene["scene"]["bodies"][0]["material"];
  EXPECT_THAT(material["weights"].get<std::string>(), HasSubstr("weights_cube.safetensors"));
  EXPECT_FALSE(material.contains("weight_moves"));
  EXPECT_TRUE(fs::exists(clip.folder.path / "out/weights_cube.safetensors"));
  const Json likes = likes_of_file(clip.folder.path / "out/material.json", {});
  EXPECT_THAT(likes["material"]["sentence"].get<std::string>(), HasSubstr("Most like"));
}

TEST(FitNeural, MadeLikeAMaterialOfAFileItIsLikeIt) {
  const Folder folder;
  const Json material = {{"law", "neo_hookean"}, {"E", 4e4}, {"nu", 0.4}};
  write_file(folder.path / "rubber.json", Json{{"material", material}}.dump());
  PretrainOptions options;
  options.folder = folder.path;
  options.materials = {folder.path / "rubber.json"};
  const Json report = write_start_laws(options);
  EXPECT_EQ(report.size(), 1U);
  EXPECT_LT(report["rubber"]["stress_rms"].get<double>(), 0.01);
  const Json made = {{"law", "neural_isotropic"}, {"weights", "rubber.safetensors"}};
  write_file(folder.path / "made.json", Json{{"material", made}}.dump());
  const Json like = likes_of_file(folder.path / "made.json", {})["made"];
  EXPECT_EQ(like["law"], "neo_hookean");
  EXPECT_NEAR(like["parameters"]["E"].get<double>(), 4e4, 0.02 * 4e4);
  EXPECT_NEAR(like["parameters"]["nu"].get<double>(), 0.4, 0.02 * 0.4);
  options.materials = {folder.path / "made.json"};
  EXPECT_THAT(message_of([&] { (void)write_start_laws(options); }),
              HasSubstr("is of the neural law already"));
}

TEST(FitNeural, WeightMovesOfAnotherLawOrTooFewAreRefused) {
  Json document = thrown_cube();
  Json& material = document["scene"]["bodies"][0]["material"];
  material["weight_moves"] = {0.0};
  EXPECT_THAT(message_of([&] { (void)job_of(document, {}); }),
              HasSubstr("the law neo_hookean has no weights"));
  material = {{"law", "neural_isotropic"}, {"weight_moves", {0.0, 0.1}}};
  EXPECT_THAT(message_of([&] { (void)job_of(document, {}); }), HasSubstr("has 2 numbers"));
}

TEST(FitNeural, WhatAClassicalLawIsLikeIsRefused) {
  const Folder folder;
  write_file(folder.path / "job.json", thrown_cube().dump());
  EXPECT_THAT(message_of([&] { (void)likes_of_file(folder.path / "job.json", {}); }),
              HasSubstr("no body is of the law neural_isotropic"));
  write_file(folder.path / "other.json", "[]");
  EXPECT_THAT(message_of([&] { (void)likes_of_file(folder.path / "other.json", {}); }),
              HasSubstr("is no job document"));
}

}  // namespace
}  // namespace matterfit::job
