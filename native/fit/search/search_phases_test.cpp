// SPDX-License-Identifier: GPL-3.0-or-later
// The order of a search, with numbers in place of simulations.
#include "fit/search/search_phases.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <limits>

#include "base/error.hpp"
#include "fit/model/step_plan.hpp"
#include "fit/search/race.hpp"

namespace matterfit::fit {
namespace {

/// A search of one number. Each stage ends after one iteration, at the next of `ends`; what it
/// misses the capture by is the distance of the value from 1.
class FakeWork final : public SearchWork {
 public:
  std::vector<double> start{5.0};
  SecondStart second;
  bool torn = false;
  std::deque<double> ends;        ///< where the stages end, one after the other
  bool finer_level = false;       ///< the first level does not show the motion
  std::vector<double> scanned;    ///< what another scan finds; empty: nothing better
  std::optional<Failure> cannot;  ///< why no stage can be begun
  std::string bursts;             ///< why no iteration can be completed
  std::vector<int> refinements;   ///< of every stage's substeps
  int iterations = 1;             ///< of a stage
  double far_off = 0.5;
  std::vector<std::size_t> begun;  ///< the stages, in the order in which they were begun
  int scans = 0;

  void find_start(LawState& state) override {
    state.values = start;
    state.second = second;
    state.torn = torn;
  }
  bool skip_level(LawState& state) override {
    if (!finer_level) return false;
    finer_level = false;
    state.stage = state.first_stage = 2;
    return true;
  }
  bool rescan(LawState& state) override {
    ++scans;
    if (scanned.empty()) return false;
    state.values = scanned;
    return true;
  }
  std::optional<Failure> begin_stage(LawState& state) override {
    if (cannot) return cannot;
    begun.push_back(state.stage);
    state.search.emplace();
    state.refinements = refinements;
    return std::nullopt;
  }
  std::optional<LawState> iterated(const LawState& state, std::vector<SearchStep>& history,
                                   std::string& failure) override {
    if (!bursts.empty()) {
      failure = bursts;
      return std::nullopt;
    }
    LawState next = state;
    ++next.iterations;
    ++next.search->iteration;
    if (next.search->iteration == iterations) {
      if (!ends.empty()) {
        next.values = {ends.front()};
        ends.pop_front();
      }
      next.search->finish(true, "no step helps");
    }
    next.search->residual = Eigen::VectorXd::Constant(1, next.values[0] - 1.0);
    history.emplace_back().iteration = next.search->iteration;
    return next;
  }
  double mean_missed(const LawState& state) override { return std::abs(state.values[0] - 1.0); }
  double rms_missed(const LawState& state) override { return mean_missed(state); }
  bool is_far(const LawState& state) override { return mean_missed(state) > far_off; }
  double far() override { return far_off; }
};

/// A search over two windows at twice the particle separation, then at the separation itself.
struct FakeSearch {
  FakeWork work;
  std::vector<SearchStage> stages =
      stages_of({2.0, 1.0}, {Window{{0.1}, 3, 6}, Window{{0.3}, 3, 12}});
  SearchPhases phases{stages, work};
  LawState state;
  std::vector<SearchStep> history;

  FakeSearch() { state.values = {0.0}; }
  void step() { phases.advance(state, history); }
  /// To the beginning of the first stage.
  void begin() {
    step();
    step();
  }
  void finish() {
    for (int k = 0; k < 100 && !state.finished(); ++k) step();
    EXPECT_TRUE(state.finished());
  }
};

using Stages = std::vector<std::size_t>;

TEST(SearchPhases, GoesFromTheStartThroughAllStages) {
  FakeSearch search;
  search.work.ends = {1.3, 1.2, 1.1};
  EXPECT_TRUE(std::holds_alternative<NotBegun>(search.state.phase));
  search.step();
  EXPECT_TRUE(std::holds_alternative<InStage>(search.state.phase));
  EXPECT_EQ(search.state.values, search.work.start);
  EXPECT_EQ(search.state.candidates, (std::vector<std::vector<double>>{{5.0}}));
  EXPECT_FALSE(search.state.search) << "the stage is begun by a step of its own";
  search.step();
  EXPECT_TRUE(search.state.search);
  search.step();
  EXPECT_EQ(search.state.stage, 1U);
  EXPECT_FALSE(search.state.search);
  search.finish();
  EXPECT_EQ(search.work.begun, (Stages{0, 1, 2}));
  EXPECT_TRUE(search.state.converged());
  EXPECT_EQ(search.state.reason(), "no step helps");
  EXPECT_EQ(search.state.values, std::vector<double>{1.1});
  EXPECT_EQ(search.history.size(), 3U);
  EXPECT_EQ(search.work.scans, 0);
  search.step();
  EXPECT_EQ(search.history.size(), 3U) << "nothing follows the end";
}

TEST(SearchPhases, WithoutParametersThereIsNothingToSearch) {
  FakeSearch search;
  search.state.values.clear();
  search.step();
  EXPECT_TRUE(search.state.converged());
  EXPECT_NE(search.state.reason().find("No parameter"), std::string::npos);
  EXPECT_TRUE(search.work.begun.empty());
}

TEST(SearchPhases, AStageGoesOnUntilItsSearchIsFinished) {
  FakeSearch search;
  search.work.iterations = 3;
  search.work.ends = {1.0};
  search.begin();
  search.step();
  search.step();
  EXPECT_EQ(search.state.stage, 0U);
  EXPECT_EQ(search.state.search->iteration, 2);
  search.step();
  EXPECT_EQ(search.state.stage, 1U);
}

TEST(SearchPhases, AFirstStageThatEndsFarOffIsScannedOnceMore) {
  FakeSearch search;
  search.work.scanned = {2.0};
  search.work.ends = {4.0, 3.0};
  search.begin();
  search.step();
  EXPECT_TRUE(std::holds_alternative<FarOff>(search.state.phase));
  EXPECT_TRUE(search.state.search) << "what the stage found is kept";
  search.step();
  EXPECT_TRUE(std::holds_alternative<InStage>(search.state.phase));
  EXPECT_FALSE(search.state.search);
  EXPECT_EQ(search.state.values, std::vector<double>{2.0});
  EXPECT_EQ(search.state.stage, 0U);
  search.finish();
  EXPECT_EQ(search.work.scans, 1) << "far off again, but there is no third time";
  EXPECT_EQ(search.work.begun, (Stages{0, 0, 1, 2}));
}

TEST(SearchPhases, WhereAnotherScanFindsNothingTheNextStageFollows) {
  FakeSearch search;
  search.work.ends = {4.0};
  search.begin();
  search.step();
  ASSERT_TRUE(std::holds_alternative<FarOff>(search.state.phase));
  search.step();
  EXPECT_EQ(search.work.scans, 1);
  EXPECT_EQ(search.state.stage, 1U);
  EXPECT_EQ(search.state.values, std::vector<double>{4.0});
}

TEST(SearchPhases, AFinerLevelIsTriedBeforeAnotherScan) {
  FakeSearch search;
  search.work.finer_level = true;
  search.work.ends = {4.0, 3.0};
  search.begin();
  search.step();
  ASSERT_TRUE(std::holds_alternative<FarOff>(search.state.phase));
  search.step();
  EXPECT_EQ(search.work.scans, 0);
  EXPECT_FALSE(search.state.search);
  EXPECT_EQ(search.state.candidates.back(), std::vector<double>{4.0});
  search.step();
  EXPECT_EQ(search.work.begun, (Stages{0, 2}));
  search.step();
  EXPECT_TRUE(std::holds_alternative<FarOff>(search.state.phase)) << "it is the first stage now";
  search.step();
  EXPECT_EQ(search.work.scans, 1);
}

TEST(SearchPhases, ALaterStageThatEndsFarOffIsNotScanned) {
  FakeSearch search;
  search.work.ends = {1.0, 4.0, 4.0};
  search.step();
  search.finish();
  EXPECT_EQ(search.work.scans, 0);
  EXPECT_EQ(search.state.values, std::vector<double>{4.0});
}

TEST(SearchPhases, ATornStartIsJudgedByTheWholeClip) {
  FakeSearch search;
  search.work.torn = true;
  search.work.ends = {4.0, 4.0};
  search.begin();
  search.step();
  EXPECT_EQ(search.state.stage, 1U) << "the first window says nothing of it";
  search.step();
  search.step();
  EXPECT_TRUE(std::holds_alternative<FarOff>(search.state.phase));
}

TEST(SearchPhases, TheLastStageIsRepeatedOnceWithTheSubstepsOfItsEnd) {
  FakeSearch search;
  search.work.ends = {1.0, 1.0, 1.0, 1.0};
  search.work.refinements = {0, 1};
  search.step();
  search.finish();
  EXPECT_EQ(search.work.begun, (Stages{0, 1, 2, 2}));
  EXPECT_EQ(search.state.repeats, 1);
}

TEST(SearchPhases, SubstepsThatAreTheSameOrNotSettledRepeatNothing) {
  FakeSearch search;
  search.work.ends = {1.0, 1.0, 1.0};
  search.work.refinements = {0, StepPlan::kUnsettled};
  search.step();
  search.finish();
  EXPECT_EQ(search.work.begun, (Stages{0, 1, 2}));
}

TEST(SearchPhases, ASecondStartIsDroppedWhereTheFirstComesNear) {
  FakeSearch search;
  search.work.second = OtherStart{{3.0}};
  search.work.ends = {1.0, 1.1, 1.2};
  search.step();
  search.finish();
  EXPECT_EQ(search.work.begun, (Stages{0, 1, 2}));
  EXPECT_TRUE(std::holds_alternative<std::monostate>(search.state.second));
  EXPECT_TRUE(search.state.statements.empty());
}

TEST(SearchPhases, ASecondStartIsTakenWhereItEndsNearer) {
  FakeSearch search;
  search.work.second = OtherStart{{3.0}};
  search.work.ends = {4.0, 4.0, 1.0, 1.1, 1.2};
  search.begin();
  search.step();
  EXPECT_EQ(search.state.stage, 1U) << "only the whole clip judges";
  search.step();
  search.step();
  EXPECT_EQ(search.state.values, std::vector<double>{3.0});
  EXPECT_EQ(search.state.stage, 0U);
  ASSERT_TRUE(std::holds_alternative<FirstEnd>(search.state.second));
  EXPECT_EQ(std::get<FirstEnd>(search.state.second).values, std::vector<double>{4.0});
  EXPECT_EQ(std::get<FirstEnd>(search.state.second).mean, 3.0);
  search.finish();
  EXPECT_EQ(search.work.begun, (Stages{0, 1, 0, 1, 2}));
  EXPECT_EQ(search.state.values, std::vector<double>{1.2});
  ASSERT_EQ(search.state.statements.size(), 1U);
  EXPECT_NE(search.state.statements[0].find("the second is taken"), std::string::npos);
}

TEST(SearchPhases, OfTwoStartsTheFirstIsTakenWhereTheSecondEndsFartherOff) {
  FakeSearch search;
  search.work.torn = true;
  search.work.second = OtherStart{{3.0}};
  search.work.ends = {4.0, 4.0, 6.0, 6.0, 1.3, 1.2};
  search.step();
  search.finish();
  // The whole first level again from where the first ended, then the next one.
  EXPECT_EQ(search.work.begun, (Stages{0, 1, 0, 1, 1, 2}));
  ASSERT_EQ(search.state.statements.size(), 1U);
  EXPECT_NE(search.state.statements[0].find("the other motion 5e+03 mm: the first is taken"),
            std::string::npos)
      << search.state.statements[0];
}

TEST(SearchPhases, ASecondStartThatCannotBeSimulatedLeadsBackToTheFirst) {
  for (const bool at_its_beginning : {true, false}) {
    FakeSearch search;
    search.work.second = OtherStart{{3.0}};
    search.work.ends = {4.0, 4.0};
    search.begin();
    while (!std::holds_alternative<FirstEnd>(search.state.second)) search.step();
    if (at_its_beginning) {
      search.work.cannot = Failure{"it burst", false};
    } else {
      search.step();
      search.work.bursts = "it burst";
    }
    search.step();
    EXPECT_FALSE(search.state.finished());
    EXPECT_EQ(search.state.values, std::vector<double>{4.0});
    EXPECT_EQ(search.state.stage, 1U) << "the whole clip at the first level";
    EXPECT_TRUE(std::holds_alternative<std::monostate>(search.state.second));
    EXPECT_FALSE(search.state.search);
  }
}

TEST(SearchPhases, WhereNothingWasFoundYetAFailureIsAnErrorAndTheStateAsBefore) {
  for (const bool by_input : {true, false}) {
    FakeSearch search;
    search.step();
    search.work.cannot = Failure{"it burst", by_input};
    try {
      search.step();
      FAIL() << "no error";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), by_input ? ErrorKind::kInput : ErrorKind::kCompute);
      EXPECT_NE(std::string(error.what()).find("it burst"), std::string::npos);
    }
    EXPECT_TRUE(std::holds_alternative<InStage>(search.state.phase));
    EXPECT_FALSE(search.state.search);
    search.work.cannot.reset();
    search.step();
    search.work.bursts = "it burst";
    EXPECT_THROW(search.step(), Error);
    EXPECT_TRUE(search.state.search);
    EXPECT_FALSE(search.state.finished());
  }
}

TEST(SearchPhases, LaterAFailureEndsTheSearchWithTheValuesSoFar) {
  FakeSearch search;
  search.work.ends = {1.2};
  search.begin();
  search.step();
  search.work.cannot = Failure{"it burst", false};
  search.step();
  EXPECT_TRUE(search.state.finished());
  EXPECT_FALSE(search.state.converged());
  EXPECT_EQ(search.state.reason(),
            "Stopped before the stage frames 3-12, separation ×2. The simulation could not be "
            "completed: it burst");
  EXPECT_EQ(search.state.values, std::vector<double>{1.2});

  FakeSearch other;
  other.work.ends = {1.2};
  other.begin();
  other.step();
  other.step();
  other.work.bursts = "it burst";
  other.step();
  EXPECT_TRUE(other.state.finished());
  EXPECT_EQ(other.state.reason(), "Stopped in the stage frames 3-12, separation ×2: it burst");
}

TEST(SearchPhases, StandingsAreTakenEveryFifthIterationAndAtTheEndOfAStage) {
  FakeSearch search;
  search.work.start = {1.25};
  search.work.iterations = 7;
  search.work.ends = {1.125};
  search.begin();
  for (int k = 0; k < 4; ++k) search.step();
  EXPECT_TRUE(search.state.standings.empty());
  search.step();
  ASSERT_EQ(search.state.standings.size(), 1U);
  EXPECT_EQ(search.state.standings[0].back().rms, 0.25);
  EXPECT_FALSE(search.state.standings[0].back().firm) << "over a part of the clip";
  EXPECT_FALSE(search.state.standings[0].back().far);
  search.step();
  EXPECT_EQ(search.state.standings[0].size(), 1U);
  search.step();
  ASSERT_EQ(search.state.standings[0].size(), 2U);
  EXPECT_EQ(search.state.standings[0].back().rms, 0.125);
}

TEST(SearchPhases, AFirstStageThatAnotherScanMayLeaveIsAnEarlyStandingAtACoarseLevel) {
  FakeSearch search;
  search.work.ends = {4.0, 4.0};
  search.begin();
  search.step();
  ASSERT_EQ(search.state.standings.size(), 1U);
  EXPECT_TRUE(search.state.standings[0].back().early);
  EXPECT_FALSE(search.state.standings[0].back().firm);
  search.step();  // the scan, which finds nothing
  search.step();
  search.step();
  ASSERT_EQ(search.state.standings.size(), 2U);
  EXPECT_TRUE(search.state.standings[1].back().firm);
  EXPECT_FALSE(search.state.standings[1].back().early);
  EXPECT_TRUE(search.state.standings[1].back().far);
}

TEST(SearchPhases, ALawThatWasLeftGoesOnWhereItWas) {
  FakeSearch search;
  search.work.ends = {4.0};
  search.begin();
  leave(search.state, "another came nearer");
  EXPECT_TRUE(search.state.finished() && search.state.left());
  EXPECT_FALSE(search.state.converged());
  EXPECT_EQ(search.state.reason(), "another came nearer");
  search.step();
  EXPECT_TRUE(search.history.empty());
  spare(search.state);
  EXPECT_TRUE(search.state.spared);
  search.step();
  EXPECT_EQ(search.history.size(), 1U);
  ASSERT_TRUE(std::holds_alternative<FarOff>(search.state.phase));
  leave(search.state, "another came nearer");
  spare(search.state);
  EXPECT_TRUE(std::holds_alternative<FarOff>(search.state.phase));
}

}  // namespace
}  // namespace matterfit::fit
