// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/capture_scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.hpp"

namespace matterfit::job {
namespace {

using testing::HasSubstr;

Json scene_document() {
  return Json::parse(R"({ "schema": "matterfit.job/1", "task": "compare",
    "scene": { "fps": 24, "frames": [0, 10], "particle_separation": 0.05, "gravity": [0, 0, -10],
      "bodies": [ { "name": "a", "source": { "box": { "low": [0,0,0], "high": [1,1,1] } },
                    "density": 1000, "velocity": [1, 0, 0],
                    "material": { "law": "neo_hookean", "E": 1e5, "nu": 0.3 } } ],
      "colliders": [ { "name": "ground", "shape": "ground", "contact": { "mu": 0.2 } } ] },
    "captures": [ { "tracks": "first.npz" } ],
    "output": { "folder": "out", "points": true } })");
}

Job read_scene(const Json& json) {
  ReadOptions options;
  options.base_folder = "/base";
  return read_job(json.dump(), options);
}

TEST(CaptureScene, ListsMergeByNameAndValuesReplace) {
  Json json = scene_document();
  json["captures"].push_back({{"tracks", "second.npz"},
                              {"scene",
                               {{"frames", {0, 20}},
                                {"gravity", nullptr},
                                {"bodies",
                                 {{{"name", "a"},
                                   {"velocity", {0, 2, 0}},
                                   {"material", {{"E", 2e5}}},
                                   {"masses", {{{"position", {0, 0, 0}}, {"mass", 0.1}}}}}}},
                                {"colliders",
                                 {{{"name", "wall"}, {"shape", "plane"}, {"normal", {1, 0, 0}}},
                                  {{"name", "ground"}, {"contact", {{"kind", "sticky"}}}}}}}}});
  const Job job = read_scene(json);
  EXPECT_EQ(job.captures[0].scene, nullptr);
  const SceneDoc& own = *job.captures[1].scene;
  EXPECT_EQ(own.end_frame, 20);
  EXPECT_EQ(own.gravity.values[0], Vec3d(0, 0, -9.81));  // the default: null removes
  EXPECT_EQ(own.bodies.size(), 1U);
  EXPECT_EQ(own.bodies[0].velocity, Vec3d(0, 2, 0));
  EXPECT_EQ(own.bodies[0].material.youngs_modulus, 2e5);
  EXPECT_EQ(own.bodies[0].material.poisson_ratio, 0.3);
  EXPECT_EQ(own.bodies[0].masses.size(), 1U);
  ASSERT_EQ(own.colliders.size(), 2U);
  EXPECT_EQ(own.colliders[0].contact.kind, shape::ContactKind::kGlue);
  EXPECT_EQ(own.colliders[0].contact.mu, 0.2);
  EXPECT_EQ(job.scene.bodies[0].velocity, Vec3d(1, 0, 0));
}

TEST(CaptureScene, EqualScenesShareARun) {
  Json json = scene_document();
  const Json other = {{"gravity", {0, 0, -3}}};
  json["captures"].push_back({{"tracks", "b.npz"}, {"scene", other}});
  json["captures"].push_back({{"tracks", "c.npz"}, {"scene", {{"gravity", {0, 0, -4}}}}});
  json["captures"].push_back({{"tracks", "d.npz"}, {"scene", other}});
  json["captures"].push_back({{"tracks", "e.npz"}, {"scene", Json::object()}});
  const Job job = read_scene(json);
  const auto groups = scene_groups(job);
  ASSERT_EQ(groups.size(), 3U);
  EXPECT_THAT(groups[0].captures, testing::ElementsAre(0, 4));
  EXPECT_THAT(groups[1].captures, testing::ElementsAre(1, 3));
  EXPECT_THAT(groups[2].captures, testing::ElementsAre(2));
  const Job alone = group_job(job, groups[1]);
  EXPECT_EQ(alone.scene.gravity.values[0].z(), -3.0);
  EXPECT_EQ(alone.output.folder, "/base/out/runs/b");
  EXPECT_FALSE(alone.output.points);
  EXPECT_EQ(alone.task, Task::kCompare);
  ASSERT_EQ(alone.captures.size(), 2U);
  EXPECT_EQ(alone.captures[1].name, "d");
  EXPECT_EQ(alone.captures[1].path, "captures[3]");
  EXPECT_EQ(alone.captures[1].scene, nullptr);
  EXPECT_EQ(group_job(job, groups[0]).captures.size(), 2U);
}

TEST(CaptureScene, ErrorsNameThePath) {
  const auto refusal = [](const Json& overrides) -> std::string {
    Json json = scene_document();
    json["captures"][0]["scene"] = overrides;
    try {
      (void)read_scene(json);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was refused";
  };
  EXPECT_THAT(refusal(3), HasSubstr("captures[0].scene is 3, expected an object"));
  EXPECT_THAT(refusal({{"frames", {3, 2}}}), HasSubstr("captures[0].scene.frames: the range"));
  EXPECT_THAT(refusal({{"bodies", {{{"density", 1}}}}}),
              HasSubstr("captures[0].scene.bodies[0]: 'name' is missing"));
  EXPECT_THAT(refusal({{"bodies", {{{"name", "a"}, {"density", -1}}}}}),
              HasSubstr("captures[0].scene.bodies[0].density is -1"));
  EXPECT_THAT(refusal({{"gravitty", {0, 0, 0}}}),
              HasSubstr("captures[0].scene: unknown key 'gravitty'"));
}

}  // namespace
}  // namespace matterfit::job
