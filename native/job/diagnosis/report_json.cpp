// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/report_json.hpp"

#include <cmath>

#include "job/diagnosis/run_diagnose.hpp"

namespace matterfit::job {
namespace {

Json sizes(const diagnose::Sizes& sizes) {
  return {{"rms", number_json(sizes.rms)}, {"p95", number_json(sizes.p95)}};
}

/// By capture: the frames, and the score over a window about each.
Json evidence_json(const std::vector<double>& score,
                   const std::vector<diagnose::Capture>& captures) {
  Json list = Json::array();
  std::size_t at = 0;
  for (const diagnose::Capture& capture : captures) {
    Json frames = Json::array();
    Json scores = Json::array();
    for (std::size_t f = 0; f < capture.times.size(); ++f, ++at) {
      frames.push_back(capture.frames.empty() ? static_cast<int>(f) : capture.frames[f]);
      scores.push_back(number_json(score[at]));
    }
    list.push_back({{"capture", capture.name}, {"frames", frames}, {"score", scores}});
  }
  return list;
}

void put_values(const std::vector<diagnose::Value>& values, Json& json) {
  for (const diagnose::Value& value : values) {
    json[value.name] = {{"value", number_json(value.value)},
                        {"unit", value.unit},
                        {"stderr", number_json(value.error)}};
  }
}

/// `Row`: a cause or the law's row.
template <class Row>
void put_gain(const Row& row, Json& json) {
  json["gain"] = row.gain_measurable ? number_json(row.gain) : Json();
  json["gain_interval"] =
      row.gain_measurable ? Json{number_json(row.gain_low), number_json(row.gain_high)} : Json();
}

Json law_json(const diagnose::LawRow& law) {
  Json json = {{"score", number_json(law.score)},
               {"p", number_json(law.p)},
               {"keep", number_json(law.keep)},
               {"observable", law.observable},
               {"refitted", law.refitted},
               {"improves", law.refitted && law.end == diagnose::LawTrial::End::kImproves},
               {"explained", number_json(law.explained)},
               {"parameters", Json::object()},
               {"sentence", law.sentence}};
  put_gain(law, json);
  put_values(law.parameters, json["parameters"]);
  return json;
}

Json cause_json(const diagnose::Cause& cause, const std::vector<diagnose::Capture>& captures) {
  Json json = {{"effect", cause.effect},
               {"scope", cause.scope},
               {"group", cause.group},
               {"sentence", cause.sentence},
               {"evidence", cause.evidence},
               {"probability", number_json(cause.probability)},
               {"score", number_json(cause.score)},
               {"p", number_json(cause.p)},
               {"keep", number_json(cause.keep)},
               {"observable", cause.observable},
               {"refitted", cause.refitted},
               {"accepted", cause.accepted},
               {"explained", number_json(cause.explained)},
               {"absorbed", number_json(cause.absorbed)},
               {"holdout_before", number_json(cause.holdout_before)},
               {"holdout_after", number_json(cause.holdout_after)},
               {"holdout_floor", number_json(cause.holdout_floor)},
               {"last_residual", number_json(cause.last_residual)},
               {"free_field", number_json(cause.free_field)},
               {"parameters", Json::object()},
               {"confused_with", Json::array()}};
  if (!cause.where.empty()) json["where"] = cause.where;
  put_gain(cause, json);
  put_values(cause.parameters, json["parameters"]);
  for (const diagnose::Confusion& rival : cause.confused_with) {
    json["confused_with"].push_back(
        {{"effect", rival.effect}, {"scope", rival.scope}, {"cosine", number_json(rival.cosine)}});
  }
  if (!cause.evidence_by_frame.empty()) {
    json["evidence_by_frame"] = evidence_json(cause.evidence_by_frame, captures);
  }
  return json;
}

}  // namespace

Json number_json(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json report_json(const diagnose::Report& report, const std::vector<diagnose::Capture>& captures) {
  const auto name_of = [&](int capture) {
    return captures[static_cast<std::size_t>(capture)].name;
  };
  Json json = {{"schema", kReportSchema},
               {"verdict", diagnose::name(report.verdict)},
               {"sentence", report.headline},
               {"class", report.classes},
               {"shown", {{"unit", report.shown.unit}, {"factor", report.shown.factor}}},
               {"noise",
                {{"sigma", number_json(report.noise.sigma)},
                 {"autocorrelation", number_json(report.noise.autocorrelation)},
                 {"common", number_json(report.noise.common_sigma)},
                 {"place", number_json(report.noise.place_sigma)},
                 {"kurtosis", number_json(report.noise.kurtosis)}}},
               {"numerical", number_json(report.numerical)},
               {"grid_bias", number_json(report.bias)},
               {"threshold", number_json(report.threshold)},
               {"p", number_json(report.p)},
               {"smooth_p", number_json(report.smooth_p)},
               {"smooth_p_after", number_json(report.smooth_p_after)},
               {"explained", number_json(report.explained)},
               {"remains", report.remains},
               {"cut", report.cut},
               {"probability",
                {{"nothing", number_json(report.probability_nothing)},
                 {"unknown", number_json(report.probability_unknown)}}},
               {"not_observable", report.not_observable},
               {"next_recording", report.next_recording},
               {"runs", report.runs},
               {"tested", report.tested},
               {"causes", Json::array()},
               {"detection_limits", Json::object()}};
  for (const auto& [stage, runs] : report.by_stage) json["runs_by_stage"][stage] = runs;
  Json residual = {{"train", sizes(report.train)},
                   {"holdout", sizes(report.holdout)},
                   {"by_frame", Json::array()},
                   {"worst", Json::array()},
                   {"wrong", Json::array()}};
  for (const diagnose::FrameError& row : report.by_frame) {
    residual["by_frame"].push_back({{"capture", name_of(row.capture)},
                                    {"frame", row.frame},
                                    {"time", row.time},
                                    {"before", number_json(row.rms)},
                                    {"after", number_json(row.after)},
                                    {"noise", number_json(row.noise)},
                                    {"numerical", number_json(row.numerical)},
                                    {"held_out", row.held_out}});
  }
  for (const diagnose::WorstFrame& worst : report.worst) {
    residual["worst"].push_back({{"capture", name_of(worst.capture)},
                                 {"frame", worst.frame},
                                 {"where", {worst.where.x(), worst.where.y(), worst.where.z()}},
                                 {"size", number_json(worst.size)}});
  }
  for (const diagnose::WrongPlace& wrong : report.wrong) {
    residual["wrong"].push_back({{"capture", name_of(wrong.capture)},
                                 {"frame", wrong.frame},
                                 {"region", wrong.region},
                                 {"sigmas", number_json(wrong.sigmas)}});
  }
  residual["regions"] = Json::object();
  for (std::size_t c = 0; c < report.regions.size(); ++c) {
    residual["regions"][captures[c].name] = report.regions[c];
  }
  json["residual"] = std::move(residual);
  for (const diagnose::Cause& cause : report.causes)
    json["causes"].push_back(cause_json(cause, captures));
  if (report.law) json["law"] = law_json(*report.law);
  for (const diagnose::DetectionLimit& limit : report.detection_limits) {
    const std::string key = limit.number.empty() ? limit.effect : limit.effect + "." + limit.number;
    json["detection_limits"][key] = {{"value", number_json(limit.value)}, {"unit", limit.unit}};
  }
  return json;
}

}  // namespace matterfit::job
