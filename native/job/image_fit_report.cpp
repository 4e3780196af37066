// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/image_fit_report.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "job/fit_report.hpp"
#include "job/image_fit_words.hpp"
#include "job/run/image_sightings.hpp"

namespace matterfit::job {
namespace {

/// Outlines that overlap less, and are farther apart than the stated noise times this, are of a
/// motion that is another than the recording's.
constexpr double kPoorOverlap = 0.9;
constexpr double kFarApart = 2.0;

/// The mean intersection over union of "fitted" or "held_out"; nothing where there is none.
std::optional<double> overlap_of(const Json& silhouettes, const char* which) {
  const Json& part = silhouettes.at(which);
  if (!part.is_object() || !part.contains("iou") || !part.at("iou").is_number()) return {};
  return part.at("iou").get<double>();
}

std::string overlap_warning(const Json& silhouettes, double noise_scale, bool finds_throw) {
  const std::optional<double> overlap = overlap_of(silhouettes, "fitted");
  if (!(noise_scale > kFarApart) || !overlap || *overlap >= kPoorOverlap) return "";
  return fmt::format(
      "The outlines that were fitted overlap by {:.1f} % only and are {:.2g} times the stated "
      "noise "
      "apart: {} Look at the overlays for what the scene lacks.",
      100.0 * *overlap, noise_scale,
      finds_throw
          ? "the search may have ended at a wrong throw or spin, whose errors do not say so. "
            "Begin from a velocity and a spin that are nearer."
          : "the scene's throw, placement or cameras are not the recording's.");
}

/// What was held out must be met about as what was fitted is: a camera that stands elsewhere than
/// its file says, or the mattes of another body, judge nothing.
std::string unmet_warning(const Json& silhouettes) {
  constexpr double kMuchLess = 0.6;  // of the overlap of what was fitted
  const std::optional<double> fitted = overlap_of(silhouettes, "fitted");
  const std::optional<double> held = overlap_of(silhouettes, "held_out");
  if (!fitted || !held || *held >= kMuchLess * *fitted) return "";
  return fmt::format(
      "The outlines that were held out overlap by {:.1f} % only, those that were fitted by {:.1f} "
      "%: the values do not predict them. Look at the overlays: the scene may lack something, or a "
      "camera stands elsewhere than its file says.",
      100.0 * *held, 100.0 * *fitted);
}

void add_sentence(const std::string& more, Json& warning) {
  if (more.empty()) return;
  const auto before = warning.get<std::string>();
  warning = before.empty() ? more : before + " " + more;
}

}  // namespace

Json image_fit_json(const ImageFitEnd& end, std::vector<std::string> statements) {
  const ImageFitState& state = end.state;
  const ImageStanding& after = end.after;
  const std::string outlines = outlines_text(state.before.at("silhouettes"), after.silhouettes);
  if (!outlines.empty()) statements.push_back(outlines);
  state_apart(after.cameras, statements);
  const std::string weights = end.scene.has_tracks() ? weights_text(end.misfit) : "";
  if (!weights.empty()) statements.push_back(weights);
  if (end.known) {
    for (const fit::Estimate& estimate : end.known->estimates) {
      if (!estimate.statement.empty()) statements.push_back(estimate.statement);
    }
    statements.insert(statements.end(), end.known->statements.begin(), end.known->statements.end());
  }
  const BodyDoc& body = end.job.scene.bodies.front();
  const auto scale = [](double square) {
    return std::isfinite(square) ? Json(std::sqrt(square)) : Json();
  };
  Json json = {
      {"law", material::traits(body.material.law).name},
      {"converged", !state.search || state.search->converged},
      {"reason", state.search ? state.search->reason : "Weights alone were moved."},
      {"loss", std::string("silhouette") +
                   (end.scene.has_tracks() ? " and " + std::string(loss_name(end.doc.loss)) : "")},
      {"iterations", state.iterations},
      {"evaluations", state.evaluations},
      {"seconds", state.seconds},
      {"parameters", parameters_json(end.parameters.parameters(), state.values, end.known)},
      {"correlation", end.known ? correlation_json(*end.known) : Json()},
      {"noise_scale", end.known ? Json(end.known->noise_scale) : Json()},
      {"noise_scales",
       {{"images", scale(end.misfit.images)},
        {"colours", scale(end.misfit.colours)},
        {"tracks", scale(end.misfit.tracks)}}},
      {"statements", statements},
      {"before", state.before.at("tracks")},
      {"after", after.tracks},
      {"silhouettes", {{"before", state.before.at("silhouettes")}, {"after", after.silhouettes}}},
      {"cameras", after.cameras},
      {"history", state.history}};
  json["warning"] = fit_warning(json, false);
  add_sentence(
      overlap_warning(after.silhouettes, std::sqrt(end.misfit.images), end.scene.finds_throw()),
      json["warning"]);
  for (const std::string& doubtful : end.scene.films().warnings) {
    add_sentence(doubtful, json["warning"]);
  }
  add_sentence(unmet_warning(after.silhouettes), json["warning"]);
  add_sentence(held_out_warning(after.tracks), json["warning"]);
  return json;
}

}  // namespace matterfit::job
