// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "base/message_for_test.hpp"
#include "base/parallel.hpp"
#include "job/documents/capture_scene.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/fit_values.hpp"
#include "job/run/build_scene.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using testing::HasSubstr;

/// A job's scenes, as a fit builds them, and its parameters.
struct ParametersFixture {
  explicit ParametersFixture(const Json& document, const fs::path& folder)
      : job(job_of(document, folder)) {
    Arena arena(1);
    loaded = unread_experiment(job);
    for (const fit::Run& run : loaded.experiment.runs) {
      scenes.push_back(run.build(1.0, arena, Interrupter()));
    }
    parameters.emplace(job.fit->parameters, loaded.experiment.runs, scenes);
  }
  Job job;
  LoadedExperiment loaded;
  std::vector<mpm::Scene> scenes;
  std::optional<fit::Parameters> parameters;
};

/// Captures a, of the document's scene, and b, c, … with a scene of their own each.
Json with_scenes(const std::vector<Json>& overrides, const Json& parameters) {
  Json document = fit_of(thrown_cube(), {});
  document["scene"]["bodies"][0]["material"]["maxwell"] = {{{"modulus", 1e3}, {"time", 0.1}},
                                                           {{"modulus", 2e3}, {"time", 0.5}}};
  char name = 'b';
  for (const Json& scene : overrides) {
    document["captures"].push_back({{"tracks", std::string(1, name++) + ".npz"}, {"scene", scene}});
  }
  document["fit"]["parameters"] = parameters;
  return document;
}

std::string refusal(const Json& document) {
  return message_of([&] {
    const Folder folder;
    (void)ParametersFixture(document, folder.path);
  });
}

TEST(FitParameters, ASceneThatLacksTheQuantityIsRefused) {
  const Json fewer = {
      {"bodies",
       {{{"name", "cube"}, {"material", {{"maxwell", {{{"modulus", 1e3}, {"time", 0.1}}}}}}}}}};
  EXPECT_THAT(refusal(with_scenes({fewer}, {"material.maxwell[1].modulus"})),
              HasSubstr("fit.parameters[0]: 'bodies.cube.material.maxwell[1].modulus' acts on the "
                        "scene of the capture 'b' too, and there the material has 1 Maxwell"));
  const Json ball = {{"colliders",
                      {{{"name", "ground"},
                        {"shape", "sphere"},
                        {"radius", 1},
                        {"transform", {{"position", {0, 0, -1}}}}}}}};
  EXPECT_THAT(refusal(with_scenes({ball}, {"colliders.ground.height"})),
              HasSubstr("the scene of the capture 'b' too, and there only the shape 'ground'"));
  const Json glued = {{"colliders", {{{"name", "ground"}, {"contact", {{"kind", "glue"}}}}}}};
  EXPECT_THAT(refusal(with_scenes({glued, glued}, {"colliders.ground.contact.mu"})),
              HasSubstr("the scene of the capture 'b', 'c' too, and there the collider's contact"));
  Json document = with_scenes({thrown_cube()["scene"]}, {"material.yield_stress"});
  document["scene"]["bodies"][0]["material"]["law"] = "von_mises";
  document["scene"]["bodies"][0]["material"]["yield_stress"] = 1e3;
  document["captures"][1]["scene"] = {
      {"bodies",
       {{{"name", "cube"}, {"material", {{"law", "neo_hookean"}, {"yield_stress", nullptr}}}}}}};
  EXPECT_THAT(refusal(document), HasSubstr("and there the law neo_hookean does not use it."));
}

TEST(FitParameters, OneQuantityOfASceneIsOneNumber) {
  const Json thrown = {{"bodies", {{{"name", "cube"}, {"density", 900}}}}};
  EXPECT_THAT(
      refusal(with_scenes({thrown, thrown}, {"captures.b.velocity", "captures.c.velocity"})),
      HasSubstr("fit.parameters[1]: 'captures.c.bodies.cube.velocity[0]' is there already, "
                "as 'captures.b.bodies.cube.velocity[0]': the captures 'b', 'c' share"));
  // In whatever order they stand, a capture's own number holds in its scene.
  for (const Json& order :
       {Json{"velocity", "captures.b.velocity[2]"}, Json{"captures.b.velocity[2]", "velocity"}}) {
    const Folder folder;
    const ParametersFixture fixture(with_scenes({thrown}, order), folder.path);
    const bool own_last = order[0] == "velocity";
    const std::vector<double> values =
        own_last ? std::vector<double>{1, 2, 3, 4} : std::vector<double>{4, 1, 2, 3};
    for (std::size_t s = 0; s < 2; ++s) {
      mpm::Scene scene = fixture.scenes[s];
      fixture.parameters->apply(values, s, scene);
      EXPECT_EQ(scene.bodies[0].velocity, Vec3d(1, 2, s == 0 ? 3 : 4)) << order;
    }
    Json written = fixture.job.document;
    write_values(*fixture.parameters, values, fixture.loaded.sources, fixture.job, written);
    const Job fitted = job_of(written, folder.path);
    EXPECT_EQ(fitted.scene.bodies[0].velocity, Vec3d(1, 2, 3)) << order;
    EXPECT_EQ(fitted.captures[1].scene->bodies[0].velocity, Vec3d(1, 2, 4)) << order;
  }
}

TEST(FitParameters, AStartIsLookedAtBeforeItsBounds) {
  const auto start = [](const std::string& path, double value) {
    return refusal(with_scenes({}, {{{"path", path}, {"start", value}}}));
  };
  EXPECT_THAT(start("material.damping_shear", 0.0),
              HasSubstr("fit.parameters[0]: bodies.cube.material.damping_shear starts at 0, "
                        "expected a start above 0."));
  EXPECT_THAT(start("material.E", -1.0), HasSubstr("starts at -1, expected a start above 0."));
  EXPECT_THAT(start("material.nu", 0.5), HasSubstr("expected a start between 0 and 0.5."));
  const Folder folder;
  EXPECT_NO_THROW(
      (void)ParametersFixture(with_scenes({}, {"material.damping_shear"}), folder.path));
}

}  // namespace
}  // namespace matterfit::job
