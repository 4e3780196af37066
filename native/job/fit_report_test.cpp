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
  EXPECT_EQ(fit_warning(ended(true, 1.1)), "");
  EXPECT_EQ(fit_warning(ended(true, nullptr)), "");
  EXPECT_EQ(fit_warning(ended(true, 9.0)), "");
  EXPECT_THAT(fit_warning(ended(false, 1.1)),
              AllOf(HasSubstr("minimum. The limit was reached."), Not(HasSubstr("the noise"))));
  EXPECT_THAT(fit_warning(ended(true, 93.0)), HasSubstr("93 times the noise"));
  EXPECT_THAT(fit_warning(ended(false, 93.0)),
              AllOf(HasSubstr("limit was reached"), HasSubstr("93 times the noise")));
}

}  // namespace
}  // namespace matterfit::job
