// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace matterfit::job {
namespace {

using testing::AllOf;
using testing::HasSubstr;

Json ended(bool converged, const Json& noise) {
  return {{"converged", converged}, {"reason", "The limit was reached."}, {"noise_scale", noise}};
}

TEST(FitReport, WarnsOfWhatIsNoResult) {
  EXPECT_EQ(fit_warning(ended(true, 1.1), false), "");
  EXPECT_EQ(fit_warning(ended(true, nullptr), false), "");
  // Tracks without noise: many times next to nothing is not far.
  EXPECT_EQ(fit_warning(ended(true, 900.0), false), "");
  EXPECT_THAT(
      fit_warning(ended(false, 1.1), false),
      AllOf(HasSubstr("minimum: The limit was reached. Begin"), Not(HasSubstr("its noise"))));
  EXPECT_THAT(fit_warning(ended(true, 93.0), true), HasSubstr("93 times that"));
  EXPECT_THAT(fit_warning(ended(true, nullptr), true), HasSubstr("than its noise:"));
  EXPECT_THAT(fit_warning(ended(false, 93.0), true),
              AllOf(HasSubstr("limit was reached"), HasSubstr("93 times")));
}

TEST(FitReport, WarnsOfWhatPredictsNothing) {
  const auto errors = [](double mean, double percent) {
    return Json{{"mean_mm", mean}, {"mean_percent", percent}};
  };
  EXPECT_THAT(held_out_warning({{"fitted", errors(1, 0.4)}, {"held_out", errors(489, 200)}}),
              AllOf(HasSubstr("489 mm (200 %"), HasSubstr("by 1 mm")));
  EXPECT_EQ(held_out_warning({{"fitted", errors(1, 0.4)}, {"held_out", errors(4, 1.6)}}), "");
  EXPECT_EQ(held_out_warning({{"fitted", errors(100, 40)}, {"held_out", errors(489, 200)}}), "");
  EXPECT_EQ(held_out_warning({{"fitted", errors(1, 0.4)}, {"held_out", nullptr}}), "");
}

}  // namespace
}  // namespace matterfit::job
