// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/run_diagnose.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>

#include "base/message_for_test.hpp"
#include "job/diagnosis/report_for_test.hpp"
#include "job/fit_fixture_for_test.hpp"

/// An effect is hidden in the data; the scene that is diagnosed knows nothing of it.
namespace matterfit::job {
namespace {

using namespace fit_test;
using ::testing::HasSubstr;

constexpr double kNoise = 1e-3;  // of the body's size
constexpr double kLift = 5.0;    // of the cube above the ground, which it does not reach [m]

/// A light cube in flight, of 64 particles: no grid is too coarse for that.
Json flying_cube() {
  Json document = thrown_cube();
  Json& scene = document["scene"];
  scene["particle_separation"] = 0.1;
  Json& body = scene["bodies"][0];
  body["density"] = 20.0;
  body["velocity"] = {5.0, 2.0, 1.0};
  body["source"]["box"] = {{"low", {0.0, 0.0, 0.1 + kLift}}, {"high", {0.4, 0.4, 0.5 + kLift}}};
  return document;
}

using Change = std::function<void(Json& scene)>;

/// The diagnosis of the cube's recording by the scene without what `hide` did to the truth.
Json diagnosed(const Folder& folder, const Change& hide) {
  Json truth = flying_cube();
  hide(truth["scene"]);
  Points points = markers();
  for (Vec3d& x : points) x.z() += kLift;
  record(truth, folder.path, "a", 5, kNoise, points);
  Json document = flying_cube();
  document["task"] = "diagnose";
  document["captures"] = {
      {{"tracks", "a.npz"}, {"noise", kNoise * kSize}, {"holdout", {{"frames", {11, 14}}}}}};
  document["fit"] = {{"parameters", {"velocity"}}, {"levels", {1}}};
  document["diagnose"] = {{"members", 12},
                          {"refits", 3},
                          {"most_causes", 1},
                          {"central", false},
                          {"ignored", {"drag_quadratic"}}};
  return run(document, folder.path);
}

TEST(Diagnose, NothingHiddenIsNothingFound) {
  const Folder folder;
  const Json report = diagnosed(folder, [](Json&) {});
  EXPECT_EQ(report.at("verdict"), "nothing") << report.at("sentence");
  EXPECT_FALSE(report.contains("model"));
  EXPECT_FALSE(report.at("detection_limits").empty());
  EXPECT_TRUE(fs::exists(folder.path / "out/diagnosis.html"));
}

TEST(Diagnose, AirDragIsFoundAndPaysOnWhatWasHeldOut) {
  const Folder folder;
  const Json report = diagnosed(folder, [](Json& scene) {
    scene["effects"] = {{{"effect", "drag_quadratic"}, {"drag_coefficient", 1.0}}};
  });
  EXPECT_TRUE(names(report, "drag_quadratic")) << report.at("sentence");
  const Json& cause = cause_of(report, "drag_quadratic");
  const Json& value = cause.at("parameters").at("drag_coefficient");
  EXPECT_NEAR(value.at("value").get<double>(), 1.0, 0.3) << cause.dump(1);
  EXPECT_GT(cause.at("gain").get<double>(), 0.5) << report.at("sentence");
  // It is examined as others are, and marked.
  EXPECT_TRUE(cause.at("ignored").get<bool>());
  EXPECT_FALSE(report.at("causes").back().contains("ignored"));
  // A body that flies without a change of shape says nothing of another law, nor can that fly as
  // in air.
  EXPECT_FALSE(report.at("law").at("refitted").get<bool>());
  EXPECT_LT(cause.at("absorbed").get<double>(), 0.5);
  // Over time as well, and when the evidence arrives.
  double before = 0.0;
  double after = 0.0;
  for (const Json& row : report.at("residual").at("by_frame")) {
    before += row.at("before").get<double>();
    after += row.at("after").get<double>();
  }
  EXPECT_LT(after, before);
  const Json& arrives = cause.at("evidence_by_frame").at(0);
  EXPECT_EQ(arrives.at("capture"), report.at("residual").at("by_frame").at(0).at("capture"));
  EXPECT_EQ(arrives.at("frames").size(), arrives.at("score").size());
  EXPECT_FALSE(report.at("residual").at("regions").empty());
  // The model with what was accepted runs as it is.
  ASSERT_TRUE(report.contains("model")) << report.at("sentence");
  Json extended = read_json(folder.path / "out/extended.json");
  extended["output"]["folder"] = "again";
  extended.erase("captures");
  EXPECT_EQ(run(extended, folder.path / "out").at("status"), "done");
}

/// In flight a wrong gravity, length and frame rate look alike.
TEST(Diagnose, WrongGravityIsOneOfItsTies) {
  const Folder folder;
  const Json report = diagnosed(folder, [](Json& scene) { scene["gravity"] = {0.0, 0.0, -9.0}; });
  EXPECT_TRUE(names(report, "gravity_size")) << report.at("sentence");
  // No other flight of this cube tells gravity and length apart.
  const std::string next = report.at("next_recording");
  EXPECT_TRUE(next.empty() || next.find("gravity_size and scale stay alike") != std::string::npos)
      << next;
}

/// The scene knows of no wall; what bounced back was fitted as a slow throw.
TEST(Diagnose, AWallThatNobodyListedIsFound) {
  const Folder folder;
  const Json report = diagnosed(folder, [](Json& scene) {
    scene["colliders"].push_back({{"name", "wall"},
                                  {"shape", "plane"},
                                  {"point", {1.4, 0.0, 0.0}},
                                  {"normal", {-1.0, 0.0, 0.0}}});
  });
  EXPECT_TRUE(names(report, "hidden_collider")) << report.at("sentence");
  const Json& cause = cause_of(report, "hidden_collider");
  EXPECT_GT(cause.at("gain").get<double>(), 0.7) << report.at("sentence");
  Json extended = read_json(folder.path / "out/extended.json");
  EXPECT_EQ(extended.at("scene").at("colliders").size(), 2U);
  extended["output"]["folder"] = "again";
  extended.erase("captures");
  EXPECT_EQ(run(extended, folder.path / "out").at("status"), "done");
}

TEST(Diagnose, WithoutAFitItSaysWhatIsMissing) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 5, kNoise);
  Json document = thrown_cube();
  document["task"] = "diagnose";
  document["captures"] = {{{"tracks", "a.npz"}}};
  EXPECT_THAT(message_of([&] { (void)run(document, folder.path); }),
              HasSubstr("add a section 'fit'"));
  document["fit"] = {{"parameters", {"velocity"}}};
  document["diagnose"] = {{"member", 3}};
  EXPECT_THAT(message_of([&] { (void)run(document, folder.path); }),
              HasSubstr("diagnose: unknown key 'member'"));
  document["diagnose"] = {{"ignored", "wind"}};
  EXPECT_THAT(message_of([&] { (void)run(document, folder.path); }),
              HasSubstr("diagnose.ignored: expected a list"));
}

/// A body that flies without turning tells its throw and nothing of its stiffness.
TEST(Check, SaysBeforeAFitWhatAFlightTells) {
  const Folder folder;
  Points points = markers();
  for (Vec3d& x : points) x.z() += kLift;
  record(flying_cube(), folder.path, "a", 5, kNoise, points);
  Json document = flying_cube();
  document["task"] = "check";
  document["scene"]["bodies"][0].erase("velocity");
  document["captures"] = {{{"tracks", "a.npz"}, {"noise", kNoise * kSize}}};
  document["fit"] = {{"parameters", {"velocity", "material.E"}}};
  const Json result = run(document, folder.path);
  ASSERT_EQ(result.at("parameters").size(), 4U);
  const Json& along = result.at("parameters").at(0);
  EXPECT_TRUE(along.at("known").get<bool>()) << result.dump(1);
  EXPECT_NEAR(along.at("start").get<double>(), 5.0, 0.1);
  EXPECT_LT(along.at("error").get<double>(), 0.01);
  EXPECT_FALSE(result.at("parameters").at(3).at("known").get<bool>()) << result.dump(1);
  EXPECT_TRUE(fs::exists(folder.path / "out/check.json"));
  EXPECT_FALSE(fs::exists(folder.path / "out/fit"));
}

}  // namespace
}  // namespace matterfit::job
