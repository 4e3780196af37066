// SPDX-License-Identifier: GPL-3.0-or-later
// Fits with the latent law: the class of the material is not said.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "base/message_for_test.hpp"
#include "fit/search/equation_start.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fit_experiment.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/fit_laws.hpp"
#include "material/neural/latent.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using testing::HasSubstr;

/// A clip of the fixture's cube of a material, thrown down, fitted with the latent law alone; the
/// last three frames are held out.
Json fitted(const Json& material) {
  const Folder folder;
  Json truth = thrown_cube();
  truth["scene"]["bodies"][0]["material"] = material;
  truth["scene"]["bodies"][0]["velocity"] = {0.8, 0.3, -2.5};
  truth["scene"]["bodies"][0]["formulation"] = "updated";
  record(truth, folder.path, "a", 1);
  Json document = fit_of(truth, {"material.E"});
  document["scene"]["bodies"][0]["material"] = {{"law", "neo_hookean"}, {"E", 3e5}, {"nu", 0.3}};
  document["fit"]["laws"] = {"latent"};
  document["fit"]["levels"] = {1};
  document["captures"][0]["holdout"] = {{"frames", {11, 14}}};
  const Json result = run(document, folder.path);
  const Json& fit = result["fit"];
  testing::Test::RecordProperty(
      "summary", fit["before"]["held_out"]["mean_mm"].dump() + " mm held out, then " +
                     fit["after"]["held_out"]["mean_mm"].dump() + "; " +
                     fit["like"]["cube"]["sentence"].dump() + fit["statements"].dump());
  return result;
}

double held_out(const Json& result, const char* when) {
  return result["fit"][when]["held_out"]["mean_mm"].get<double>();
}

TEST(FitLatent, FindsPlasticine) {
  const Json result =
      fitted({{"law", "von_mises"}, {"E", 1e5}, {"nu", 0.3}, {"yield_stress", 2e3}});
  EXPECT_LT(held_out(result, "after"), 0.2 * held_out(result, "before"));
  EXPECT_THAT(result["fit"]["statements"].dump(), HasSubstr("Looked for as each class of flow"));
}

/// The fixture's cube as a grid of as many points along each edge.
Points grid(int along) {
  Points points;
  const double step = kSize / double(along);
  for (int k = 0; k < along; ++k) {
    for (int j = 0; j < along; ++j) {
      for (int i = 0; i < along; ++i) {
        points.push_back(Vec3d(0.0, 0.0, 0.1) + step * (Vec3d(i, j, k).array() + 0.5).matrix());
      }
    }
  }
  return points;
}

TEST(FitLatent, TheBalanceOfDenseTracksMovesTheCodeFromEachClass) {
  const Folder folder;
  Json truth = thrown_cube();
  truth["scene"]["bodies"][0]["formulation"] = "updated";
  record(truth, folder.path, "a", 1, 2e-3, grid(8));
  Json document = fit_of(truth, {"material.E"});
  document["scene"]["bodies"][0]["material"] = {{"law", "latent"}, {"E", 1e5}};
  for (std::size_t k = 0; k < material::kLatentSize; ++k) {
    document["fit"]["parameters"].push_back("material.latent[" + std::to_string(k) + "]");
  }
  const Job job = job_of(document, folder.path);
  std::vector<std::string> statements;
  const Interrupter interrupter;
  const LoadedExperiment loaded = prepare_experiment(job, 2, interrupter, statements);
  Arena arena(2);
  const std::vector<mpm::Scene> scenes{
      loaded.experiment.runs.front().build(1.0, arena, interrupter)};
  const fit::Parameters parameters(job.fit->parameters, loaded.experiment.runs, scenes);
  const std::vector<fit::FlowStart> starts =
      fit::flow_starts(parameters, scenes, parameters.starts());
  ASSERT_EQ(starts.size(), material::kLatentClasses.size());
  const fit::EquationStart ranked =
      fit::rank_classes(loaded.experiment.runs, scenes, parameters, starts, 2, interrupter);
  EXPECT_THAT(ranked.statement, HasSubstr("looked at from each class of flow"));
  ASSERT_EQ(ranked.candidates.size(), 3U) << ranked.statement;
  // A code is moved as a whole; before, what was found of it was left out.
  const bool moved = std::any_of(
      ranked.candidates.begin(), ranked.candidates.end(), [&](const std::vector<double>& found) {
        return std::none_of(starts.begin(), starts.end(), [&](const fit::FlowStart& start) {
          return std::equal(found.begin() + 1, found.end(), start.values.begin() + 1);
        });
      });
  EXPECT_TRUE(moved) << ranked.statement;
}

TEST(FitLatent, ItsStiffnessIsLookedForWithItsCode) {
  Json document = fit_of(thrown_cube(), {"velocity"});
  document["fit"]["laws"] = {"latent"};
  const Job job = job_of(document, {});
  std::string listed;
  for (const fit::ParameterSpec& parameter :
       parameters_of_law(*job.fit, material::Law::kNeoHookean, material::Law::kLatent)) {
    listed += parameter.path.text() + " ";
  }
  EXPECT_THAT(listed, HasSubstr("bodies.cube.material.E "));
  EXPECT_THAT(listed, HasSubstr("bodies.cube.material.latent[7] "));
  EXPECT_THAT(listed, HasSubstr("bodies.cube.velocity "));
}

TEST(FitLatent, ABadCodeIsRefused) {
  Json document = thrown_cube();
  Json& material = document["scene"]["bodies"][0]["material"];
  material = {{"law", "latent"}, {"E", 1e5}, {"latent", {0.0, 1.0}}};
  EXPECT_THAT(message_of([&] { (void)job_of(document, {}); }),
              HasSubstr("has 2 numbers; a code has 8"));
  material = {{"law", "latent"}, {"E", 1e5}, {"weights", "jelly"}};
  EXPECT_THAT(message_of([&] { (void)job_of(document, {}); }),
              HasSubstr("the law latent has the weights 'latent'"));
  material = {{"law", "latent"}};
  EXPECT_THAT(message_of([&] { (void)job_of(document, {}); }), HasSubstr("'E' is missing"));
}

}  // namespace
}  // namespace matterfit::job
