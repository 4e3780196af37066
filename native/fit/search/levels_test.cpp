// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/levels.hpp"

#include <gtest/gtest.h>

#include "fit/search/stages.hpp"

namespace matterfit::fit {
namespace {

/// A block of so many particles along the axes of its lattice, two a cell.
mpm::Scene block_scene(int x, int y, int z, const Quatd& axes = Quatd::Identity()) {
  mpm::Scene scene;
  scene.dx = 0.02;
  mpm::Body body;
  body.lattice.axes = axes;
  for (int i = 0; i < x; ++i)
    for (int j = 0; j < y; ++j)
      for (int k = 0; k < z; ++k) body.rest.push_back(axes * (0.01 * Vec3d(i, j, k)));
  scene.bodies.push_back(body);
  return scene;
}

using Levels = std::vector<double>;

TEST(FitLevels, BeginsCoarseWhereThatSavesMuch) {
  EXPECT_EQ(usual_levels({block_scene(15, 15, 15)}), Levels{1.0}) << "3375 particles";
  EXPECT_EQ(usual_levels({block_scene(16, 16, 16)}), (Levels{2.0, 1.0}));
  EXPECT_EQ(usual_levels({block_scene(32, 32, 32)}), (Levels{4.0, 2.0, 1.0}));
}

TEST(FitLevels, KeepsThreeCellsAcrossTheThinnestSide) {
  EXPECT_EQ(usual_levels({block_scene(50, 50, 6)}), Levels{1.0});
  // Its box along the world's axes is a thick one.
  const Quatd turned(Eigen::AngleAxisd(0.8, Vec3d(1.0, 1.0, 0.0).normalized()));
  EXPECT_EQ(usual_levels({block_scene(50, 50, 6, turned)}), Levels{1.0});
}

TEST(FitLevels, EveryRunMustBearIt) {
  EXPECT_EQ(usual_levels({block_scene(16, 16, 16), block_scene(8, 8, 8)}), Levels{1.0});
}

TEST(FitStages, WindowsGrowAtTheFirstLevelAndTheOthersSeeTheWholeClip) {
  const std::vector<Window> windows{{{0.1}, 3, 6}, {{0.3}, 3, 12}};
  const std::vector<SearchStage> stages = stages_of({2.0, 1.0}, windows);
  ASSERT_EQ(stages.size(), 3U);
  EXPECT_EQ(stages[0].name, "frames 3-6, separation ×2");
  EXPECT_EQ(stages[1].name, "frames 3-12, separation ×2");
  EXPECT_EQ(stages[2].name, "frames 3-12");
  EXPECT_EQ(stages[0].frames, "frames 3-6");
  EXPECT_FALSE(stages[0].whole);
  EXPECT_TRUE(stages[1].whole);
  EXPECT_FALSE(stages[1].last);
  EXPECT_TRUE(stages[2].whole && stages[2].last);
  EXPECT_FALSE(stages[1].stand_in.has_value());
  EXPECT_EQ(stages[2].stand_in, 2.0) << "Jacobians come from the level before";
  EXPECT_EQ(stages[2].level, 1.0);
}

TEST(FitStages, HowMuchIsDoneNeverFalls) {
  const std::vector<Window> windows{{{0.1}, 3, 6}, {{0.3}, 3, 12}};
  const std::vector<SearchStage> stages = stages_of({2.0, 1.0}, windows);
  LawState state;
  double before = fraction_done(stages, state, 0.0);
  EXPECT_EQ(before, 0.0);
  state.evaluations = 40;
  EXPECT_GT(fraction_done(stages, state, 0.0), before);
  before = fraction_done(stages, state, 0.0);
  state.phase = InStage{};
  for (state.stage = 0; state.stage < stages.size(); ++state.stage) {
    state.search.emplace();
    for (state.search->iteration = 0; state.search->iteration < 5; ++state.search->iteration) {
      const double now = fraction_done(stages, state, 0.5);
      EXPECT_GT(now, before);
      before = now;
    }
  }
  state.search.reset();
  EXPECT_DOUBLE_EQ(fraction_done(stages, state, 0.0), 1.0);
}

}  // namespace
}  // namespace matterfit::fit
