// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/page.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

namespace matterfit::job {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Of a drag that was named, in a recording of four frames of which the last is held out.
Json report_of_drag() {
  Json report = Json::parse(R"({
    "schema": "matterfit.report/1", "verdict": "cause", "sentence": "Air drags <it>.",
    "class": ["drag_quadratic"], "tested": 24, "numerical": 0.0004,
    "shown": {"unit": "mm", "factor": 1000.0},
    "noise": {"sigma": 0.0005, "autocorrelation": 0.25},
    "probability": {"nothing": 0.001, "unknown": 0.02},
    "causes": [
      {"effect": "drag_quadratic", "scope": "shared", "sentence": "The air's own sentence.",
       "evidence": "Explains most of it.", "probability": 0.97, "score": 812.5, "p": 0.001,
       "keep": 0.41, "refitted": true, "accepted": true, "explained": 0.94, "absorbed": 0.125, "gain": 0.82,
       "gain_interval": [0.78, 0.85], "holdout_before": 0.0061, "holdout_after": 0.0011,
       "holdout_floor": 0.0007, "last_residual": 0.0052, "free_field": 0.0033,
       "parameters": {"drag_coefficient": {"value": 0.47, "unit": "", "stderr": 0.012}},
       "confused_with": [{"effect": "drag_linear", "scope": "shared", "cosine": 0.99}],
       "evidence_by_frame": [{"capture": "a", "frames": [1, 2, 3, 4], "score": [1, 5, 9, 0]}]},
      {"effect": "wind", "scope": "shared", "sentence": "A wind.", "evidence": "Less well.",
       "probability": 0.002, "score": 3.5, "p": 0.4, "keep": 0.2, "refitted": false,
       "accepted": false, "explained": 0.0, "gain": null, "gain_interval": null,
       "parameters": {}, "confused_with": []}],
    "residual": {"train": {"rms": 0.004, "p95": 0.007}, "holdout": {"rms": 0.006, "p95": 0.009},
      "by_frame": [], "regions": {"a": ["−x", "+x"]},
      "worst": [{"frame": 4, "capture": "a", "where": [0.1, 0.2, 0.3], "size": 0.0088}],
      "wrong": [{"capture": "a", "frame": 3, "region": 1, "sigmas": 7.25}]},
    "not_observable": ["time_offset"],
    "detection_limits": {"wind.velocity[0]": {"value": 0.4, "unit": "m/s"}},
    "next_recording": "", "statements": ["A note."]
  })");
  for (int frame = 1; frame <= 4; ++frame) {
    report["residual"]["by_frame"].push_back({{"capture", "a"},
                                              {"frame", frame},
                                              {"time", 0.02 * frame},
                                              {"before", 0.001 * frame},
                                              {"after", 0.0003},
                                              {"noise", 0.0005},
                                              {"numerical", 0.0004},
                                              {"held_out", frame == 4}});
  }
  return report;
}

void gather(const Json& json, std::set<double>& numbers) {
  if (json.is_number()) numbers.insert(json.get<double>());
  if (json.is_structured()) {
    for (const Json& part : json) gather(part, numbers);
  }
}

TEST(Page, ShowsBeforeAndAfterAboveNoiseAndSolver) {
  const std::string html = report_page(report_of_drag());
  for (const char* part :
       {"polyline class=\"before\"", "polyline class=\"after\"", "polygon class=\"noise\"",
        "polygon class=\"solver\"", "rect class=\"held\"", "with the extended model"}) {
    EXPECT_THAT(html, HasSubstr(part));
  }
  Json unnamed = report_of_drag();
  for (Json& row : unnamed["residual"]["by_frame"]) row["after"] = nullptr;
  EXPECT_THAT(report_page(unnamed), Not(HasSubstr("with the extended model")));
}

TEST(Page, ShowsWhatIsWrongWhereAndWhenTheEvidenceArrives) {
  const std::string html = report_page(report_of_drag());
  EXPECT_THAT(html, HasSubstr("rect class=\"wrong\""));
  EXPECT_THAT(html, HasSubstr(", part +x: "));
  EXPECT_THAT(html, HasSubstr("Worst frames"));
  EXPECT_THAT(html, HasSubstr("polygon class=\"score\""));
}

TEST(Page, SaysTheCausesOwnSentences) {
  const std::string html = report_page(report_of_drag());
  EXPECT_THAT(html, HasSubstr("The air's own sentence."));
  EXPECT_THAT(html, HasSubstr("A wind."));
  EXPECT_THAT(html, HasSubstr("Air drags &lt;it&gt;."));
  EXPECT_THAT(html, HasSubstr("share of the excess explained"));
  EXPECT_THAT(html, HasSubstr("of which another law could make"));
}

TEST(Page, ShowsTheReportsNumbersToTheLastDigit) {
  const Json report = report_of_drag();
  std::set<double> numbers;
  gather(report, numbers);
  const std::string html = report_page(report);
  const std::string mark = "data-value=\"";
  int found = 0;
  for (auto at = html.find(mark); at != std::string::npos; at = html.find(mark, at + 1)) {
    const std::string value =
        html.substr(at + mark.size(), html.find('"', at + mark.size()) - at - mark.size());
    EXPECT_TRUE(numbers.contains(std::stod(value))) << value;
    ++found;
  }
  EXPECT_GT(found, 30);
}

TEST(Page, AsksForNothingFromElsewhere) {
  const std::string html = report_page(report_of_drag());
  for (const char* part : {"http", "src=", "<script", "@import", "url("}) {
    EXPECT_THAT(html, Not(HasSubstr(part)));
  }
}

TEST(Page, OfAReportThatHasNextToNothing) {
  const std::string html = report_page(Json{{"sentence", "Nothing is wrong."}});
  EXPECT_THAT(html, HasSubstr("Nothing is wrong."));
  EXPECT_THAT(html, Not(HasSubstr("<svg")));
}

}  // namespace
}  // namespace matterfit::job
