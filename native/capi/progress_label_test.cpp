// SPDX-License-Identifier: GPL-3.0-or-later
#include "capi/progress_label.hpp"

#include <gtest/gtest.h>

namespace matterfit::capi {
namespace {

TEST(ProgressLabel, SaysAsMuchAsThereIsRoomFor) {
  Progress progress;
  progress.label = "Fitting: sand ×2, iteration 4";
  progress.shorter = {"Fitting: sand ×2", "Fitting ×2"};
  EXPECT_EQ(label_within(progress, 63), progress.label);
  EXPECT_EQ(label_within(progress, progress.label.size() - 1), progress.shorter[0]);
  EXPECT_EQ(label_within(progress, 12), progress.shorter[1]);
  // "×" are two bytes, of which only the first would fit.
  EXPECT_EQ(label_within(progress, 9), "Fitting ");
  EXPECT_EQ(label_within(progress, 0), "");
}

}  // namespace
}  // namespace matterfit::capi
