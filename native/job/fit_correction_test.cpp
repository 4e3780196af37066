// SPDX-License-Identifier: GPL-3.0-or-later
// A correction beside a law: it finds what the law lacks, predicts another throw by it, and is left
// where nothing is lacking.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "base/file.hpp"
#include "base/message_for_test.hpp"
#include "job/fit_fixture_for_test.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using testing::HasSubstr;

constexpr double kThrow = -4.0;        // [m/s]
constexpr double kGentleThrow = -1.0;  // the same, at which a law that does not stiffen holds

/// The fixture's cube thrown down hard; with `stiffening` [Pa] it stiffens where it is stretched,
/// which no elastic law of the list does.
Json thrown(double stiffening, const std::vector<double>& velocity) {
  Json truth = thrown_cube();
  truth["scene"]["bodies"][0]["velocity"] = velocity;
  if (stiffening > 0.0) {
    truth["scene"]["effects"] = {{{"effect", "strain_stiffening"},
                                  {"body", "cube"},
                                  {"modulus", stiffening},
                                  {"exponent", 1.0}}};
  }
  return truth;
}

/// On a grid of its own.
Json on_another_grid(Json truth) {
  truth["scene"]["particle_separation"] = 0.04;
  truth["scene"]["solver"]["grid_shift"] = {0.3, 0.6, 0.1};
  return truth;
}

/// Clips of two throws, the first of which is fitted but for its last frames.
struct Clips {
  explicit Clips(double stiffening, double down = kThrow, bool own_grid = false) {
    const Json first = thrown(stiffening, {0.8, 0.3, down});
    record(own_grid ? first : on_another_grid(first), folder.path, "a", 1);
    other = thrown(stiffening, {-1.5, 0.5, 1.2 * down});
    other["scene"]["bodies"][0]["spin"] = {2.0, -3.0, 1.0};
    record(on_another_grid(other), folder.path, "b", 2);
    document = fit_of(thrown(0.0, {0.8, 0.3, down}), {"material.E", "material.nu"});
    document["scene"]["bodies"][0]["material"]["E"] = 5e4;
    document["fit"]["levels"] = {1};
    document["captures"][0]["holdout"] = {{"frames", {10, 14}}};
  }
  Json fit(int correction) {
    document["fit"]["correction"] = correction;
    document["output"]["folder"] = correction > 0 ? "with" : "without";
    return fit_test::run(document, folder.path);
  }
  /// The fitted material in the throw that no fit has seen [mm].
  [[nodiscard]] double unseen(const std::string& fitted) const {
    Json compared = other;
    compared["scene"].erase("effects");
    compared["task"] = "compare";
    compared["scene"]["bodies"][0]["material"] = material(fitted);
    compared["captures"] = {{{"tracks", "b.npz"}}};
    compared["output"]["folder"] = fitted + "_b";
    const Json result = fit_test::run(compared, folder.path);
    return result["compare"]["captures"][0]["mean_mm"].get<double>();
  }
  [[nodiscard]] Json material(const std::string& fitted) const {
    const auto bytes = read_file(folder.path / fitted / "material.json");
    return Json::parse(bytes.begin(), bytes.end()).at("material");
  }

  Folder folder;
  Json document;
  Json other;
};

TEST(FitCorrection, HalvesTheErrorOfAThrowThatItNeverSawWhereTheLawLacksSomething) {
  Clips clips(2e5);
  const Json alone = clips.fit(0);
  const Json result = clips.fit(12);
  const Json& correction = result["fit"]["correction"];
  ASSERT_TRUE(correction["taken"].get<bool>()) << correction;
  const double without = clips.unseen("without");
  const double with = clips.unseen("with");
  RecordProperty("summary", std::to_string(without) + " mm without, " + std::to_string(with) +
                                " with; " + correction["sentence"].get<std::string>());
  EXPECT_LT(with, 0.5 * without);
  // As the search saw it, and as the run of the result has it.
  const Json& held = correction["held_out_mm"];
  EXPECT_LT(held["with"].get<double>(), 0.98 * held["without"].get<double>());
  EXPECT_NEAR(result["fit"]["after"]["held_out"]["mean_mm"].get<double>(),
              held["with"].get<double>(), 0.1 * held["with"].get<double>());
  EXPECT_EQ(clips.material("with")["correction"], correction["numbers"]);
  EXPECT_THAT(result["fit"]["statements"].dump(), HasSubstr("with a correction beside the law"));
  EXPECT_FALSE(correction["freed"].empty());
  // It stiffens where the clip stretches most.
  double most = 1.0;
  double share_there = 0.0;
  for (const Json& share : correction["stress_share"]) {
    if (share["way"] != "stretch" || !(share["by"].get<double>() > most)) continue;
    most = share["by"].get<double>();
    share_there = share["share"].get<double>();
  }
  EXPECT_GT(share_there, 0.1) << correction;
  EXPECT_FALSE(clips.material("without").contains("correction"));
}

TEST(FitCorrection, IsLeftBitForBitWhereNothingIsLacking) {
  // On another grid the correction takes up what the grid gets wrong.
  Clips clips(0.0, kGentleThrow, true);
  const Json alone = clips.fit(0);
  const Json result = clips.fit(6);
  const Json& correction = result["fit"]["correction"];
  ASSERT_FALSE(correction["taken"].get<bool>()) << correction;
  EXPECT_EQ(bits(result), bits(alone));
  EXPECT_EQ(clips.material("with"), clips.material("without"));
  EXPECT_EQ(result["fit"]["after"], alone["fit"]["after"]);
  EXPECT_THAT(result["fit"]["statements"].dump(), HasSubstr("the law stays as it is"));
}

TEST(FitCorrection, HasADampingForWhatDependsOnTheRate) {
  constexpr double kDamping = 20.0;  // [Pa s]
  const Folder folder;
  Json truth = thrown_cube();
  Json& cube = truth["scene"]["bodies"][0];
  cube["velocity"] = {0.8, 0.3, -2.5};
  cube["material"]["damping_shear"] = kDamping;
  record(truth, folder.path, "a", 1);
  cube["material"].erase("damping_shear");
  Json document = fit_of(truth, {"material.E", "material.nu"});
  document["fit"]["levels"] = {1};
  document["fit"]["correction"] = 8;
  document["captures"][0]["holdout"] = {{"frames", {10, 14}}};
  const Json result = fit_test::run(document, folder.path);
  const Json& correction = result["fit"]["correction"];
  ASSERT_TRUE(correction["taken"].get<bool>()) << correction;
  EXPECT_TRUE(correction["damping_freed"].get<bool>());
  EXPECT_NEAR(correction["damping_shear"].get<double>(), kDamping, 0.25 * kDamping);
  EXPECT_THAT(correction["sentence"].get<std::string>(), HasSubstr("damps change of shape"));
  const Json scene = Json::parse(read_file(folder.path / "out" / "scene.json"));
  EXPECT_EQ(scene["scene"]["bodies"][0]["material"]["damping_shear"], correction["damping_shear"]);
}

TEST(FitCorrection, OfAClipThatHardlyStrainsIsNotEvenTried) {
  const Folder folder;
  Json truth = thrown_cube();
  truth["scene"]["bodies"][0]["velocity"] = {0.4, 0.2, -0.05};
  truth["scene"]["gravity"] = {0.0, 0.0, 0.0};  // it does not land
  truth["scene"]["bodies"][0]["material"]["E"] = 1e6;
  record(truth, folder.path, "a", 1);
  Json document = fit_of(truth, {"velocity"});
  document["fit"]["levels"] = {1};
  document["fit"]["correction"] = 5;
  document["captures"][0]["holdout"] = {{"frames", {11, 14}}};
  const Json result = fit_test::run(document, folder.path);
  EXPECT_TRUE(result["fit"]["correction"]["freed"].empty()) << result["fit"]["correction"];
  EXPECT_THAT(result["fit"]["statements"].dump(), HasSubstr("excites no number of a correction"));
}

/// One stiffens where it is strained, the other softens.
TEST(FitCorrection, OfTwoBodiesEachGetsItsOwn) {
  const Folder folder;
  constexpr double kApart = 2.0;
  Json first = thrown(0.0, {0.8, 0.3, kThrow});
  Json second = first;
  second["scene"]["bodies"][0]["name"] = "other";
  second["scene"]["bodies"][0]["source"]["box"] = {{"low", {kApart, 0, 0.1}},
                                                   {"high", {kApart + 0.4, 0.4, 0.5}}};
  Json document = fit_of(first, {"bodies.cube.material.E", "bodies.other.material.E"});
  document["scene"]["bodies"].push_back(second["scene"]["bodies"][0]);
  first["scene"]["bodies"][0]["material"]["correction"] = {0.0, 2.0, 0.0, 0.0, 0.0};
  second["scene"]["bodies"][0]["material"]["correction"] = {0.0, -0.5, 0.0, 0.0, 0.0};
  Points there = markers();
  for (Vec3d& x : there) x.x() += kApart;
  record(first, folder.path, "a", 1);
  record(second, folder.path, "b", 2, 2e-3, there);
  document["captures"][0].update(
      {{"body", "cube"}, {"name", "a"}, {"holdout", {{"frames", {10, 14}}}}});
  document["captures"].push_back(document["captures"][0]);
  document["captures"][1].update({{"body", "other"}, {"name", "b"}, {"tracks", "b.npz"}});
  document["fit"]["levels"] = {1};
  document["fit"]["correction"] = 4;
  const Json result = fit_test::run(document, folder.path);
  const Json& correction = result["fit"]["correction"];
  ASSERT_TRUE(correction["taken"].get<bool>()) << correction;
  EXPECT_EQ(correction["body"], "cube");
  EXPECT_EQ(correction["numbers"], correction["bodies"]["cube"]["numbers"]);
  // What each adds where it is pulled most: more, and less.
  const auto share = [&](const char* name) {
    return correction["bodies"][name]["stress_share"][3]["share"].get<double>();
  };
  // Four steps are on the way, not at the end.
  EXPECT_GT(share("cube"), 0.005) << correction;
  EXPECT_LT(share("other"), -0.01) << correction;
  const auto file = [&](const char* name) {
    const auto bytes = read_file(folder.path / "out" / name);
    return Json::parse(bytes.begin(), bytes.end());
  };
  EXPECT_EQ(file("material.json")["material"]["correction"], correction["numbers"]);
  EXPECT_EQ(file("material_other.json")["material"]["correction"],
            correction["bodies"]["other"]["numbers"]);
  // What each was seen at goes with it.
  EXPECT_GT(file("material_other.json")["excited"]["strain"].get<double>(), 0.02);
  EXPECT_TRUE(file("scene.json")["scene"]["bodies"][0].contains("excited"));
}

TEST(FitCorrection, NeedsAHoldOutAndIsChecked) {
  const Folder folder;
  record(thrown_cube(), folder.path, "a", 1);
  Json document = fit_of(thrown_cube(), {"material.E"});
  document["fit"]["correction"] = 5;
  EXPECT_THAT(message_of([&] { (void)fit_test::run(document, folder.path); }),
              HasSubstr("fit.correction: nothing is held out"));
  document["fit"]["weights"] = 5;
  EXPECT_THAT(message_of([&] { (void)job_of(document, folder.path); }),
              HasSubstr("'weights' and 'correction'"));
  Json other = thrown_cube();
  other["scene"]["bodies"][0]["material"]["correction"] = {0.0, 1.0};
  EXPECT_THAT(message_of([&] { (void)job_of(other, folder.path); }),
              HasSubstr("material.correction has 2 numbers"));
  document = fit_of(thrown_cube(), {"material.correction[7]"});
  EXPECT_THAT(message_of([&] { (void)job_of(document, folder.path); }),
              HasSubstr("a correction has 5 numbers"));
}

/// As any other number of a material, without being asked to choose.
TEST(FitCorrection, IsFittedWhereItIsListed) {
  const Folder folder;
  Json truth = thrown(0.0, {0.8, 0.3, kThrow});
  truth["scene"]["bodies"][0]["material"]["correction"] = {0.0, 2.0, 0.0, 0.0, 0.0};
  record(truth, folder.path, "a", 1);
  Json document = fit_of(thrown(0.0, {0.8, 0.3, kThrow}), {"material.E", "material.correction[1]"});
  document["fit"]["levels"] = {1};
  const Json result = fit_test::run(document, folder.path);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.correction[1]"), 2.0, 0.2);
  EXPECT_NEAR(value_of(result, "bodies.cube.material.E"), 3e4, 0.03 * 3e4);
}

}  // namespace
}  // namespace matterfit::job
