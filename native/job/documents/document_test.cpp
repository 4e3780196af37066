// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/document.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <utility>

#include "base/error.hpp"
#include "job/documents/override.hpp"

namespace matterfit::job {
namespace {

using testing::HasSubstr;

constexpr const char* kMinimal = R"({
  "schema": "matterfit.job/1",
  "scene": {
    "fps": 24, "frames": [1, 11], "particle_separation": 0.05,
    "bodies": [ { "name": "dough", "source": { "sphere": { "radius": 0.2 } }, "density": 1000,
                  "material": { "law": "neo_hookean", "E": 1e5, "nu": 0.3 } } ] } })";

Job read(const Json& document, std::vector<std::string> overrides = {}) {
  ReadOptions options;
  options.base_folder = "/base";
  options.overrides = std::move(overrides);
  return read_job(document.dump(), options);
}

Json minimal() { return Json::parse(kMinimal); }

/// The message that reading a document changed by `change` fails with.
std::string refusal(const std::function<void(Json&)>& change) {
  Json document = minimal();
  change(document);
  try {
    (void)read(document);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  return "nothing was refused";
}

TEST(JobDocument, MinimalHasTheDefaults) {
  const Job job = read(minimal());
  EXPECT_EQ(job.task, Task::kSimulate);
  EXPECT_EQ(job.scene.first_frame, 1);
  EXPECT_EQ(job.scene.end_frame, 11);
  EXPECT_EQ(job.scene.frames(), 10);
  EXPECT_DOUBLE_EQ(job.scene.seconds(13), 0.5);
  EXPECT_EQ(job.scene.gravity.values[0], Vec3d(0, 0, -9.81));
  EXPECT_EQ(job.scene.bodies[0].source.kind, Source::Kind::kSphere);
  EXPECT_EQ(job.scene.bodies[0].formulation, mpm::Formulation::kAuto);
  EXPECT_EQ(job.output.folder, "/base/out");
}

TEST(JobDocument, RationalFrameRate) {
  Json document = minimal();
  document["scene"]["fps"] = {24000, 1001};
  const Job job = read(document);
  EXPECT_DOUBLE_EQ(job.scene.fps, 24000.0 / 1001.0);
  EXPECT_EQ(job.scene.fps_ratio, (std::array<int, 2>{24000, 1001}));
}

TEST(JobDocument, UnknownKeysAreRefusedByName) {
  EXPECT_THAT(refusal([](Json& d) { d["scene"]["gravitty"] = 1; }),
              testing::AllOf(HasSubstr("scene: unknown key 'gravitty'"),
                             HasSubstr("Did you mean 'gravity'?")));
  EXPECT_THAT(refusal([](Json& d) { d["scene"]["bodies"][0]["colour"] = "red"; }),
              HasSubstr("scene.bodies[0]: unknown key 'colour'"));
  EXPECT_THAT(refusal([](Json& d) { d["extra"] = 1; }), HasSubstr("unknown key 'extra'"));
  EXPECT_THAT(refusal([](Json& d) {
                d["output"]["mesh"] = {{{"mesh", "a.ply"}, {"x", 1}}};
              }),
              HasSubstr("output.mesh[0]: unknown key 'x'"));
}

TEST(JobDocument, ErrorsNameThePathTheValueAndWhatIsExpected) {
  EXPECT_EQ(refusal([](Json& d) { d["scene"]["bodies"][0]["density"] = -5; }),
            "scene.bodies[0].density is -5, expected a number > 0 [kg/m³].");
  EXPECT_EQ(refusal([](Json& d) {
              d["scene"]["gravity"] = {1, 2};
            }),
            "scene.gravity is [1,2], expected three numbers [x, y, z].");
  EXPECT_EQ(refusal([](Json& d) {
              d["scene"]["gravity"] = {1, 2, "3"};
            }),
            "scene.gravity[2] is \"3\", expected a number from -100000 to 100000 [m/s²].");
  EXPECT_EQ(refusal([](Json& d) {
              d["scene"]["gravity"] = {0, 0, -1e200};
            }),
            "scene.gravity[2] is -1e+200, expected a number from -100000 to 100000 [m/s²].");
  EXPECT_THAT(refusal([](Json& d) {
                d["scene"]["gravity"] = {{"frames", {1, 2}}, {"values", {{0, 0, 0}, {0, 0, 1e6}}}};
              }),
              HasSubstr("scene.gravity.values[1][2] is 1000000.0, expected a number from"));
  EXPECT_EQ(refusal([](Json& d) {
              d["scene"]["bodies"][0]["placement"]["position"] = {1e12, 0, 0};
            }),
            "scene.bodies[0].placement.position[0] is 1000000000000.0, expected a number from "
            "-1000000 to 1000000 [m].");
  EXPECT_THAT(refusal([](Json& d) {
                d["scene"]["bodies"][0]["spin"] = {0, 1e6, 0};
              }),
              HasSubstr("spin[1] is 1000000.0, expected a number from -100000 to 100000 [rad/s]"));
  EXPECT_EQ(refusal([](Json& d) { d["scene"].erase("particle_separation"); }),
            "scene: 'particle_separation' is missing.");
  EXPECT_THAT(refusal([](Json& d) {
                d["scene"]["frames"] = {5, 5};
              }),
              HasSubstr("scene.frames: the range [5, 5) is empty"));
  EXPECT_THAT(refusal([](Json& d) {
                d["scene"]["frames"] = {-1, 5};
              }),
              HasSubstr("scene.frames[0] is -1"));
  EXPECT_THAT(refusal([](Json& d) {
                d["scene"]["frames"] = {0.5, 5};
              }),
              HasSubstr("scene.frames[0] is 0.5, expected a whole number"));
  EXPECT_THAT(
      refusal([](Json& d) {
        d["scene"]["effects"] = {{{"effect", "winds"}}};
      }),
      HasSubstr("scene.effects[0].effect: there is no effect 'winds'. Did you mean 'wind'?"));
  EXPECT_THAT(refusal([](Json& d) { d["schema"] = "matterfit.job/9"; }),
              HasSubstr("schema is \"matterfit.job/9\"; this version reads \"matterfit.job/1\""));
  EXPECT_THAT(refusal([](Json& d) { d["task"] = "bakke"; }),
              HasSubstr("task is \"bakke\", expected one of \"simulate\""));
}

TEST(JobDocument, MaterialsTakeTheirOwnParametersOnly) {
  EXPECT_THAT(refusal([](Json& d) {
                d["scene"]["bodies"][0]["material"] = {
                    {"law", "newtonian"}, {"bulk_modulus", 1e5}, {"E", 1e5}};
              }),
              HasSubstr("scene.bodies[0].material: the law newtonian does not use 'E'"));
  EXPECT_THAT(refusal([](Json& d) { d["scene"]["bodies"][0]["material"].erase("nu"); }),
              HasSubstr("scene.bodies[0].material: 'nu' is missing"));
  EXPECT_THAT(refusal([](Json& d) { d["scene"]["bodies"][0]["material"]["nu"] = 0.5; }),
              HasSubstr("scene.bodies[0].material"));
  EXPECT_THAT(refusal([](Json& d) { d["scene"]["bodies"][0]["material"]["law"] = "jelly"; }),
              HasSubstr("scene.bodies[0].material.law"));
}

TEST(JobDocument, OneSourceOnly) {
  EXPECT_THAT(refusal([](Json& d) { d["scene"]["bodies"][0]["source"]["mesh"] = "a.ply"; }),
              HasSubstr("has both"));
  EXPECT_THAT(refusal([](Json& d) { d["scene"]["bodies"][0]["source"] = Json::object(); }),
              HasSubstr("one of 'points', 'mesh'"));
}

TEST(JobDocument, KeyedQuantities) {
  Json document = minimal();
  document["scene"]["gravity"] = {{"frames", {1, 13, 25}},
                                  {"values", {{0, 0, -9.81}, {0, 0, 0}, {1, 0, 0}}},
                                  {"interpolation", "step"}};
  const Job job = read(document);
  const auto keyed = job.scene.gravity.in_seconds(job.scene.first_frame, job.scene.fps);
  EXPECT_EQ(keyed.times, (std::vector<double>{0.0, 0.5, 1.0}));
  EXPECT_EQ(keyed.at(0.49), Vec3d(0, 0, -9.81));
  EXPECT_EQ(keyed.at(0.5), Vec3d::Zero());
  EXPECT_THAT(refusal([](Json& d) {
                d["scene"]["gravity"] = {{"frames", {1, 1}}, {"values", {{0, 0, 0}, {0, 0, 0}}}};
              }),
              HasSubstr("scene.gravity.frames"));
  EXPECT_THAT(refusal([](Json& d) {
                d["scene"]["gravity"] = {{"frames", {1, 2}}, {"values", {{0, 0, 0}}}};
              }),
              HasSubstr("2 frames but 1 values"));
}

TEST(JobDocument, PathsAreRelativeToTheDocument) {
  Json document = minimal();
  document["scene"]["bodies"][0]["source"] = {{"mesh", "../shape.ply"}};
  document["output"]["folder"] = "cache";
  const Job job = read(document);
  EXPECT_EQ(job.scene.bodies[0].source.file, "/shape.ply");
  EXPECT_EQ(job.output.folder, "/base/cache");
}

TEST(JobDocument, WritesBackWithPathsOfItsNewFolder) {
  Json document = minimal();
  document["scene"]["bodies"][0]["source"] = {{"mesh", "shapes/a.ply"}};
  document["scene"]["colliders"] = {{{"meshes", {"c/1.ply", "c/2.ply"}}, {"first_frame", 1}}};
  document["captures"] = {{{"tracks", "t.npz"}, {"holdout", {{"tracks", {"a.b"}}}}}};
  const Job job = read(document, {"material.E=2e5"});
  const std::string text = write_job(job, "/base/deep/er");
  ReadOptions options;
  options.base_folder = "/base/deep/er";
  const Job again = read_job(text, options);
  EXPECT_EQ(again.scene.bodies[0].source.file, "/base/shapes/a.ply");
  EXPECT_EQ(again.scene.colliders[0].files[1], "/base/c/2.ply");
  EXPECT_EQ(again.captures[0].file, "/base/t.npz");
  EXPECT_EQ(again.captures[0].holdout.tracks[0], "a.b");
  EXPECT_EQ(again.scene.bodies[0].material.youngs_modulus, 2e5);
  EXPECT_EQ(Json::parse(text)["scene"]["colliders"][0]["meshes"][0], "../../c/1.ply");
}

TEST(JobDocument, BodiesOfCapturesAndContactsMustExist) {
  EXPECT_THAT(refusal([](Json& d) {
                d["captures"] = {{{"tracks", "a.npz"}, {"body", "dogh"}}};
              }),
              HasSubstr("captures[0].body: there is no body 'dogh'. Did you mean 'dough'?"));
  EXPECT_THAT(refusal([](Json& d) {
                d["scene"]["contacts"] = {{{"bodies", {"dough", "bowl"}}, {"mu", 0.1}}};
              }),
              HasSubstr("there is no body 'bowl'"));
}

TEST(JobDocument, NotJson) {
  EXPECT_THROW((void)read_job("{", {}), Error);
  // The parser's sentence, without the name of its exception.
  EXPECT_THAT([] { (void)read_job("{", {}); },
              testing::ThrowsMessage<Error>(
                  testing::AllOf(HasSubstr("not valid JSON at line 1: parse error"),
                                 testing::Not(HasSubstr("exception")))));
  EXPECT_THROW((void)read_job("[]", {}), Error);
  EXPECT_THROW((void)read_job("", {}), Error);
  EXPECT_THROW((void)read_job(R"({"schema":"matterfit.job/1","scene":1e999})", {}), Error);
  const std::string deep = std::string(100000, '[');
  EXPECT_THROW((void)read_job(deep, {}), Error);
}

TEST(JobDocument, EveryExampleReads) {
  const std::filesystem::path folder =
      std::filesystem::path(MATTERFIT_SOURCE_DIR) / "docs/examples";
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".json") continue;
    EXPECT_NO_THROW((void)read_job_file(entry.path())) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 5U);
}

TEST(Override, PathsByNameIndexAndShortForm) {
  Json document = minimal();
  apply_override(document, "scene.gravity=[0,0,-3.7]");
  EXPECT_EQ(document["scene"]["gravity"], Json::parse("[0,0,-3.7]"));
  apply_override(document, "scene.bodies.dough.material.E=2e5");
  EXPECT_EQ(document["scene"]["bodies"][0]["material"]["E"], 2e5);
  apply_override(document, "bodies[0].density=900");
  EXPECT_EQ(document["scene"]["bodies"][0]["density"], 900);
  apply_override(document, "bodies.\"dough\".spin=[0,1,0]");
  EXPECT_EQ(document["scene"]["bodies"][0]["spin"][1], 1);
  // Numbers as people type them, which JSON does not have.
  for (const auto& [text, value] : {std::pair{".4", 0.4}, {"-.5e3", -500.0}, {"+2", 2.0}}) {
    apply_override(document, std::string("material.nu=") + text);
    EXPECT_EQ(document["scene"]["bodies"][0]["material"]["nu"], value) << text;
  }
  // What is neither is a text, which the reader refuses.
  for (const char* text : {"+-2", ".4.", "inf", "1e999", "0x10", "."}) {
    apply_override(document, std::string("material.nu=") + text);
    EXPECT_EQ(document["scene"]["bodies"][0]["material"]["nu"], text);
  }
  apply_override(document, "output.folder=elsewhere");
  EXPECT_EQ(document["output"]["folder"], "elsewhere");
  apply_override(document, "frames=[0,5]");
  EXPECT_EQ(document["scene"]["frames"][1], 5);
}

TEST(Override, WhatItRefuses) {
  Json document = minimal();
  for (const char* bad : {"scene.gravity", "=3", "scene..x=1", "scene.bodies[9].density=1",
                          "scene.bodies.bread.density=1", "scene.bodies[x]=1", "scene.fps.x=1",
                          "scene[0]=1", "scene.=1", "bodies.\"dough.density=1"}) {
    EXPECT_THROW(apply_override(document, bad), Error) << bad;
  }
  document["scene"]["bodies"].push_back(document["scene"]["bodies"][0]);
  EXPECT_THROW(apply_override(document, "material.E=1"), Error);
  try {
    apply_override(document, "gravty=[0,0,-3.7]");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("did you mean 'gravity'?"));
  }
}

}  // namespace
}  // namespace matterfit::job
