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

TEST(FitReport, OfTwoModelsThatPredictAlikeTheOneOfFewerNumbersIsFirst) {
  std::vector<fit::LawState> laws(2);
  laws[0].law = "von_mises";
  laws[1].law = "neo_hookean";
  const auto model = [](double held_out, const Json& parameters) {
    return Json{
        {"held_out_mm", held_out}, {"fitted_mm", 5.0}, {"frames", 4.0}, {"parameters", parameters}};
  };
  const Json three = {{"E", 1e5}, {"nu", 0.3}, {"yield_stress", 2e5}};
  const Json two = {{"E", 1e5}, {"nu", 0.3}};
  const Json alike = ranked_models(laws, {model(15.3, three), model(15.5, two)});
  EXPECT_EQ(alike[0]["law"], "neo_hookean");
  EXPECT_LT(alike[0]["probability"].get<double>(), 0.6);
  const Json better = ranked_models(laws, {model(7.0, three), model(15.5, two)});
  EXPECT_EQ(better[0]["law"], "von_mises");
  EXPECT_GT(better[0]["probability"].get<double>(), 0.9);
}

}  // namespace
}  // namespace matterfit::job
