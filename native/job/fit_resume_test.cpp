// SPDX-License-Identifier: GPL-3.0-or-later
// A fit that is broken off anywhere goes on to the bits of an unbroken one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <variant>
#include <vector>

#include "base/file.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/fit_state.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using testing::HasSubstr;

TEST(Fit, GoesOnToTheSameBitsWithAnyNumberOfThreads) {
  const Folder whole;
  record(thrown_cube(), whole.path, "a", 1);
  const Json unbroken = run(poor_start(), whole.path, 1);
  for (const char* label :
       {"looking for a start", "frames 1-6, iteration", "frames 1-13, iteration"}) {
    const Folder folder;
    fs::copy(whole.path / "a.npz", folder.path / "a.npz");
    const Json broken = cancelled_at(poor_start(), folder.path, {label});
    ASSERT_EQ(broken["status"], "cancelled") << label;
    EXPECT_EQ(broken["exit_status"], 130);
    for (const char* name : {"material.json", "scene.json", "result.json"}) {
      EXPECT_TRUE(fs::exists(folder.path / "out" / name)) << name;
    }
    EXPECT_TRUE(fs::exists(folder.path / "out" / kFitCheckpointPath)) << label;
    (void)read_job_file(folder.path / "out/scene.json");
    const Json resumed = run(poor_start(), folder.path, 2);
    EXPECT_EQ(bits(resumed), bits(unbroken)) << label;
    EXPECT_EQ(resumed["fit"]["history"], unbroken["fit"]["history"]);
    EXPECT_EQ(resumed["result_hash"], unbroken["result_hash"]);
  }
}

TEST(Fit, LooksOnceMoreWhereTheFirstStageEndsFarOff) {
  Json truth = thrown_cube();
  truth["scene"]["bodies"][0]["material"] = {
      {"law", "von_mises"}, {"E", 6e4}, {"nu", 0.3}, {"yield_stress", 800}};
  const Json document = of_the_wrong_law();
  const Folder whole;
  record(truth, whole.path, "a", 1);
  const Json unbroken = run(document, whole.path, 1);
  EXPECT_GT(unbroken["fit"]["noise_scale"].get<double>(), 10.0);
  // The scan comes again between two stages: broken off in it, the fit goes on to the same bits.
  const Folder folder;
  fs::copy(whole.path / "a.npz", folder.path / "a.npz");
  const Json broken = cancelled_at(document, folder.path, {"iteration 1", "looking for a start"});
  ASSERT_EQ(broken["status"], "cancelled");
  const Json resumed = run(document, folder.path, 2);
  EXPECT_EQ(bits(resumed), bits(unbroken));
  EXPECT_EQ(resumed["fit"]["history"], unbroken["fit"]["history"]);
}

TEST(Fit, TriesTheOtherMotionWhereOneEndsFarOff) {
  Json truth = thrown_cube();
  Json& body = truth["scene"]["bodies"][0];
  body["material"] = {{"law", "von_mises"}, {"E", 1e5}, {"nu", 0.3}, {"yield_stress", 4e3}};
  body["velocity"] = {0.8, 0.3, -3.0};
  truth["scene"]["frames"] = {0, 10};
  const Folder whole;
  record(truth, whole.path, "a", 1);
  // However it is thrown, this elastic body does not do what that one did.
  Json document = fit_of(truth, {"velocity"});
  document["scene"]["bodies"][0]["material"] = {{"law", "neo_hookean"}, {"E", 4e5}, {"nu", 0.3}};
  document["fit"]["levels"] = {1};
  document["fit"]["iterations"] = 5;
  const Json unbroken = run(document, whole.path, 1);
  EXPECT_THAT(unbroken["fit"]["statements"].dump(), HasSubstr("began with the other motion"));
  EXPECT_THAT(unbroken["fit"]["warning"].get<std::string>(), HasSubstr("far more than its noise"));
  // Broken off in the second search the fit goes on to the same bits.
  const Folder folder;
  fs::copy(whole.path / "a.npz", folder.path / "a.npz");
  const Json broken =
      cancelled_at(document, folder.path, {"frames 1-9, iteration 1", "frames 1-6, iteration 2"});
  ASSERT_EQ(broken["status"], "cancelled");
  const Json resumed = run(document, folder.path, 2);
  EXPECT_EQ(bits(resumed), bits(unbroken));
  EXPECT_EQ(resumed["fit"]["history"], unbroken["fit"]["history"]);
  EXPECT_EQ(resumed["fit"]["statements"], unbroken["fit"]["statements"]);
}

TEST(Fit, ARaceOfLawsGoesOnToTheSameBitsAndKeepsTheBestWhenCancelled) {
  Json truth = thrown_cube();
  truth["scene"]["bodies"][0]["material"] = {
      {"law", "von_mises"}, {"E", 6e4}, {"nu", 0.3}, {"yield_stress", 800}};
  const Folder whole;
  record(truth, whole.path, "a", 1);
  Json document = fit_of(truth, {"material.E", "material.yield_stress"});
  document["scene"]["bodies"][0]["material"] = {{"law", "neo_hookean"}, {"E", 3e4}, {"nu", 0.3}};
  document["captures"][0]["holdout"] = {{"frames", {11, 14}}};
  document["fit"]["laws"] = {"neo_hookean", "von_mises"};
  document["fit"]["levels"] = {1};
  const Json unbroken = run(document, whole.path, 1);
  EXPECT_EQ(unbroken["fit"]["law"], "von_mises");
  const Json& elastic = unbroken["fit"]["models"][1];
  EXPECT_EQ(elastic["law"], "neo_hookean");
  EXPECT_THAT(elastic["reason"].get<std::string>(), HasSubstr("Left early: it missed"));
  for (const char* label : {"neo_hookean, frames 1-6", "von_mises, frames 1-6, iteration 2",
                            "von_mises, frames 1-10, iteration 1"}) {
    const Folder folder;
    fs::copy(whole.path / "a.npz", folder.path / "a.npz");
    const Json broken = cancelled_at(document, folder.path, {label});
    ASSERT_EQ(broken["status"], "cancelled") << label;
    EXPECT_TRUE(fs::exists(folder.path / "out/material.json")) << label;
    const Json resumed = run(document, folder.path, 2);
    EXPECT_EQ(bits(resumed), bits(unbroken)) << label;
    EXPECT_EQ(resumed["fit"]["models"], unbroken["fit"]["models"]) << label;
    EXPECT_EQ(resumed["fit"]["history"], unbroken["fit"]["history"]) << label;
  }
}

TEST(Fit, TheStateIsKeptToTheLastBit) {
  FitState state;
  state.input_hash = "abc";
  fit::LawState law;
  law.law = "neo_hookean";
  law.values = {1.0 / 3.0, 1e-300, 12345.678901234567};
  law.steps = {{{7, 8}, 2.0 / 7.0, {{0.5, 1.0}, {}}}};
  law.phase = fit::LeftEarly{"it missed by more", fit::FarOff{}};
  law.second = fit::FirstEnd{{0.1, 0.2}, 1.0 / 7.0};
  law.rescanned = law.spared = true;
  law.first_stage = 2;
  law.standings = {{}, {{1.0 / 3.0, true, false}, {0.1, false, true, true}}};
  law.nearest = fit::Nearest{1.0 / 7.0, Eigen::Vector3d(0.1, 1.0 / 3.0, -2.0), 1};
  law.search.emplace();
  law.search->point = Eigen::Vector3d(0.1, -0.2, 1e10 / 3.0);
  law.search->residual = Eigen::Vector2d(1.0 / 3.0, -0.0);
  law.search->cost = 0.1 + 0.2;
  law.search->anchor = Eigen::Vector3d(0.3, 0.2, 0.1);
  law.search->central = true;
  law.search->trail = {Eigen::Vector3d(0.3, 0.2, 1.0 / 7.0)};
  law.search->corrected = {0, 1};
  law.search->vain = 1;
  law.search->history = {{1, 0.3, 1e-2, true}};
  state.laws = {law};
  const Folder folder;
  write_file(folder.path / kFitCheckpointPath, format_fit_state(state));
  const auto read = read_fit_state(folder.path, "abc");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->laws[0].values, law.values);
  EXPECT_TRUE(read->laws[0].rescanned && read->laws[0].spared);
  ASSERT_TRUE(read->laws[0].left());
  EXPECT_EQ(read->laws[0].reason(), "it missed by more");
  const auto& left = std::get<fit::LeftEarly>(read->laws[0].phase);
  EXPECT_TRUE(std::holds_alternative<fit::FarOff>(left.then));
  const auto* first = std::get_if<fit::FirstEnd>(&read->laws[0].second);
  ASSERT_TRUE(first != nullptr);
  EXPECT_EQ(first->values, (std::vector<double>{0.1, 0.2}));
  EXPECT_EQ(first->mean, 1.0 / 7.0);
  EXPECT_EQ(read->laws[0].first_stage, 2U);
  ASSERT_EQ(read->laws[0].standings.size(), 2U);
  EXPECT_EQ(read->laws[0].standings[1].at(0).rms, 1.0 / 3.0);
  EXPECT_TRUE(read->laws[0].standings[1].at(0).firm);
  EXPECT_TRUE(read->laws[0].standings[1].at(1).far);
  EXPECT_EQ(read->laws[0].search->point, law.search->point);
  EXPECT_EQ(read->laws[0].search->cost, law.search->cost);
  EXPECT_TRUE(read->laws[0].search->central);
  EXPECT_EQ(read->laws[0].search->trail, law.search->trail);
  EXPECT_EQ(read->laws[0].search->corrected, law.search->corrected);
  EXPECT_EQ(read->laws[0].search->vain, 1);
  EXPECT_TRUE(std::signbit(read->laws[0].search->residual[1]));
  EXPECT_EQ(format_fit_state(*read), format_fit_state(state));
  EXPECT_FALSE(read_fit_state(folder.path, "abd"));
  std::string damaged = format_fit_state(state);
  damaged[damaged.find("12345")] = '2';
  write_file(folder.path / kFitCheckpointPath, damaged);
  EXPECT_FALSE(read_fit_state(folder.path, "abc"));
  for (const char* other : {"{\"schema\": 5}", "[1]", "{"}) {
    write_file(folder.path / kFitCheckpointPath, other);
    EXPECT_FALSE(read_fit_state(folder.path, "abc")) << other;
  }
}

TEST(Fit, EveryPhaseOfASearchIsKept) {
  FitState state;
  state.input_hash = "abc";
  for (const fit::SearchPhase& phase :
       {fit::SearchPhase(fit::NotBegun{}), fit::SearchPhase(fit::InStage{}),
        fit::SearchPhase(fit::FarOff{}), fit::SearchPhase(fit::Finished{true, "no step helps"}),
        fit::SearchPhase(fit::LeftEarly{"far", fit::InStage{}}),
        fit::SearchPhase(fit::LeftEarly{"far", fit::FarOff{}})}) {
    state.laws.emplace_back().phase = phase;
  }
  state.laws[0].second = fit::OtherStart{{0.1, 0.2}};
  const Folder folder;
  write_file(folder.path / kFitCheckpointPath, format_fit_state(state));
  const auto read = read_fit_state(folder.path, "abc");
  ASSERT_TRUE(read);
  ASSERT_EQ(read->laws.size(), state.laws.size());
  for (std::size_t k = 0; k < state.laws.size(); ++k) {
    EXPECT_EQ(read->laws[k].phase.index(), state.laws[k].phase.index()) << k;
    EXPECT_EQ(read->laws[k].second.index(), state.laws[k].second.index()) << k;
  }
  EXPECT_TRUE(read->laws[3].converged());
  EXPECT_EQ(read->laws[3].reason(), "no step helps");
  EXPECT_EQ(std::get<fit::OtherStart>(read->laws[0].second).values,
            (std::vector<double>{0.1, 0.2}));
  EXPECT_EQ(format_fit_state(*read), format_fit_state(state));
}

}  // namespace
}  // namespace matterfit::job
