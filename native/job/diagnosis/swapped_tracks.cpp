// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/swapped_tracks.hpp"

#include <fmt/format.h>

#include "diagnose/report.hpp"
#include "job/run/capture_input.hpp"

namespace matterfit::job {
namespace {

constexpr const char* kName = "swapped_tracks";
/// Entries of a long list that are named; the rest is counted.
constexpr std::size_t kListed = 3;

std::string listed(const std::vector<std::string>& labels) {
  std::string text;
  for (std::size_t k = 0; k < std::min(labels.size(), kListed); ++k) {
    text += (k == 0 ? "" : ", ") + labels[k];
  }
  if (labels.size() > kListed) text += fmt::format(", and {} more", labels.size() - kListed);
  return text;
}

Json cause_of(const SwappedTracks& found) {
  return {{"effect", kName},
          {"scope", "capture " + found.name},
          {"group", "measurement"},
          {"sentence", fmt::format("In '{}' tracks are taken for each other: {}.", found.name,
                                   listed(found.labels))},
          {"evidence",
           "The motion of the others says so, without a simulation: exchanged, each is where they "
           "take it. It was undone before the fit."},
          {"probability", 1.0},
          {"score", nullptr},
          {"p", 0.0},
          {"keep", 1.0},
          {"observable", true},
          {"refitted", false},
          {"accepted", true},
          {"explained", nullptr},
          {"holdout_before", nullptr},
          {"holdout_after", nullptr},
          {"holdout_floor", nullptr},
          {"last_residual", nullptr},
          {"free_field", nullptr},
          {"gain", nullptr},
          {"gain_interval", nullptr},
          {"parameters", Json::object()},
          {"confused_with", Json::array()}};
}

}  // namespace

std::vector<SwappedTracks> find_swapped_tracks(const Job& job) {
  std::vector<SwappedTracks> found;
  for (std::size_t c = 0; c < job.captures.size(); ++c) {
    const fit::CaptureInput input = load_capture(job, c, false);
    SwappedTracks here{c, job.captures[c].name, capture::find_swaps(input.tracks), {}};
    if (here.swaps.empty()) continue;
    for (const capture::Swap& swap : here.swaps) {
      here.labels.push_back(fmt::format("{} and {} from sample {} on", input.label(swap.first),
                                        input.label(swap.second), swap.frame));
    }
    found.push_back(std::move(here));
  }
  return found;
}

void write_swaps(const std::vector<SwappedTracks>& found, Json& document) {
  for (const SwappedTracks& here : found) {
    Json& capture = document.at("captures").at(here.capture);
    for (const capture::Swap& swap : here.swaps) {
      capture["swaps"].push_back({{"sample", swap.frame}, {"tracks", {swap.first, swap.second}}});
    }
  }
}

void report_swaps(const std::vector<SwappedTracks>& found, Json& report) {
  if (found.empty()) return;
  Json causes = Json::array();
  std::string words;
  for (const SwappedTracks& here : found) {
    causes.push_back(cause_of(here));
    words += causes.back().at("sentence").get<std::string>() + " ";
  }
  for (Json& cause : report.at("causes")) causes.push_back(std::move(cause));
  report["causes"] = std::move(causes);
  const std::string verdict = report.at("verdict");
  if (verdict != diagnose::name(diagnose::Verdict::kUnknown)) {
    Json& names = report.at("class");
    report["verdict"] = diagnose::name(names.empty() ? diagnose::Verdict::kMeasurement
                                                     : diagnose::Verdict::kSeveral);
    names.insert(names.begin(), kName);
  }
  report["sentence"] = words + "They were exchanged. " + report.at("sentence").get<std::string>();
}

}  // namespace matterfit::job
