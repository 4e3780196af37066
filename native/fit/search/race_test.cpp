// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/race.hpp"

#include <gtest/gtest.h>

namespace matterfit::fit {
namespace {

LawState law_at(const char* name, std::size_t stage,
                const std::vector<std::vector<double>>& standings, bool firm = true) {
  LawState law;
  law.law = name;
  law.stage = stage;
  for (const std::vector<double>& there : standings) {
    law.standings.emplace_back();
    for (const double rms : there) law.standings.back().push_back({rms, firm, true});
  }
  return law;
}

TEST(FitRace, TheNearestGoesOnOnceEachHasAStanding) {
  std::vector<LawState> laws{law_at("a", 0, {}), law_at("b", 0, {})};
  EXPECT_EQ(next_law(laws), 0U);
  add_standing(laws[0], {0.01, false, true});
  EXPECT_EQ(next_law(laws), 1U);
  add_standing(laws[1], {0.02, false, true});
  EXPECT_EQ(next_law(laws), 0U);
  // A longer window, which it misses by more.
  laws[0].stage = 1;
  EXPECT_EQ(next_law(laws), 0U);
  add_standing(laws[0], {0.03, true, true});
  EXPECT_EQ(next_law(laws), 1U);
  laws[1].phase = Finished{};
  EXPECT_EQ(next_law(laws), 0U);
  laws[0].phase = Finished{};
  EXPECT_FALSE(next_law(laws));
}

TEST(FitRace, LeavesALawThatMissesByFarAtTheSameStanding) {
  std::vector<LawState> laws{law_at("near", 1, {{}, {0.002, 0.001}}),
                             law_at("far", 1, {{}, {0.005}})};
  // One of the first standings is two and a half times the other.
  EXPECT_TRUE(hopeless_laws(laws).empty());
  add_standing(laws[1], {0.0035, true, true});
  const auto left = hopeless_laws(laws);
  ASSERT_EQ(left.size(), 1U);
  EXPECT_EQ(left[0].law, 1U);
  EXPECT_NE(left[0].reason.find("3.5 mm where near missed it by 1 mm"), std::string::npos)
      << left[0].reason;
}

TEST(FitRace, BeforeTheWholeClipOnlyWhatIsLostIsLeft) {
  const LawState near = law_at("near", 0, {{0.001}}, false);
  EXPECT_TRUE(hopeless_laws({near, law_at("far", 0, {{0.01}}, false)}).empty());
  EXPECT_EQ(hopeless_laws({near, law_at("lost", 0, {{0.02}}, false)}).size(), 1U);
}

TEST(FitRace, BesideOneThatIsDoneLessIsNoWrongValley) {
  LawState done = law_at("done", 0, {{0.001}}, false);
  LawState behind = law_at("behind", 0, {{0.005}}, false);
  behind.standings[0][0].early = true;
  EXPECT_TRUE(hopeless_laws({done, behind}).empty());
  done.phase = Finished{};
  EXPECT_EQ(hopeless_laws({done, behind}).size(), 1U);
  behind.standings[0][0].rms = 0.0035;
  EXPECT_TRUE(hopeless_laws({done, behind}).empty());
  // A law that was left early says nothing of how near a search can come.
  behind.standings[0][0].rms = 0.005;
  leave(done, "far off");
  EXPECT_TRUE(hopeless_laws({done, behind}).empty());
}

TEST(FitRace, OnACoarseGridNobodyIsLostBesideOneThatGoesOn) {
  LawState lost = law_at("lost", 0, {{1.0}}, false);
  lost.standings[0][0].early = true;
  EXPECT_TRUE(hopeless_laws({law_at("near", 0, {{0.001}}, false), lost}).empty());
}

TEST(FitRace, WhatEndedAStageBeforeCountsWithWhatItEndedWith) {
  std::vector<LawState> laws{law_at("quick", 2, {{}, {0.001}}),
                             law_at("slow", 1, {{}, {0.0009, 0.0031}})};
  ASSERT_EQ(hopeless_laws(laws).size(), 1U);
  // One that is still on its way to that standing says nothing.
  laws[0].stage = 1;
  EXPECT_TRUE(hopeless_laws(laws).empty());
  laws[0].phase = Finished{};
  EXPECT_EQ(hopeless_laws(laws).size(), 1U);
  laws[0].failed = "it burst";
  EXPECT_TRUE(hopeless_laws(laws).empty());
}

TEST(FitRace, WhatIsWithinTheNoiseOrWasSparedIsNotLeft) {
  const LawState near = law_at("near", 1, {{}, {0.00002}});
  LawState other = law_at("other", 1, {{}, {0.00007}});
  EXPECT_EQ(hopeless_laws({near, other}).size(), 1U);
  other.spared = true;
  EXPECT_TRUE(hopeless_laws({near, other}).empty());
  other.spared = false;
  other.standings[1][0].far = false;
  EXPECT_TRUE(hopeless_laws({near, other}).empty());
}

TEST(FitRace, TheLeaderIsWhatCameNearest) {
  LawState left = law_at("left", 1, {{}, {0.0001}});
  leave(left, "far off");
  EXPECT_FALSE(leading_law({left}));
  EXPECT_EQ(leading_law({left, law_at("first frames", 0, {{0.0005}}, false),
                         law_at("whole clip", 1, {{}, {0.002}})}),
            2U);
  EXPECT_FALSE(leading_law({law_at("a", 0, {})}));
  EXPECT_EQ(leading_law({law_at("a", 0, {}), law_at("b", 1, {{}, {0.002}}),
                         law_at("c", 1, {{}, {0.004, 0.001}})}),
            2U);
}

}  // namespace
}  // namespace matterfit::fit
