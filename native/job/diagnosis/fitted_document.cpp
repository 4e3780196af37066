// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/fitted_document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "fit/model/quantity.hpp"
#include "job/documents/capture_scene.hpp"
#include "job/documents/fit_document.hpp"
#include "job/documents/fit_path.hpp"

namespace matterfit::job {
namespace {

/// The prior that a fit has of a number, alone or as a component of a vector, as documents have it;
/// null: none.
Json prior_of(const FitDoc& fit, const fit::Address& number) {
  for (const fit::ParameterSpec& spec : fit.parameters) {
    fit::Address one = spec.path;
    if (!one.component) one.component = number.component;
    if (!spec.prior || one.capture != number.capture || !one.same_number(number)) continue;
    const std::size_t part = spec.path.component ? 0 : std::size_t(number.component.value_or(0));
    return {{"mean", spec.prior->mean[part]}, {"sigma", spec.prior->sigma}};
  }
  return {};
}

/// The fitted scene as a job whose parameters start where the fit ended, without priors.
Json without_priors(const Job& job, const Fitted& fitted) {
  Json document = fitted.document;
  document["task"] = "diagnose";
  document["output"] = job.document.value("output", Json::object());
  Json entries = Json::array();
  for (const Json& parameter : fitted.fit.at("parameters")) {
    entries.push_back({{"path", parameter.at("path")}, {"bounds", parameter.at("bounds")}});
  }
  document["fit"] = {{"parameters", std::move(entries)}};
  return document;
}

/// About a start: a factor of thirty where the bounds span decades, else three quarters of the way.
Json narrowed(double start, const Json& bounds) {
  constexpr double kFactor = 30.0;
  constexpr double kShare = 0.75;
  const double low = bounds.at(0).get<double>();
  const double high = bounds.at(1).get<double>();
  if (low > 0.0 && high > kFactor * kFactor * low) {
    return Json::array({std::max(low, start / kFactor), std::min(high, start * kFactor)});
  }
  return Json::array({start - kShare * (start - low), start + kShare * (high - start)});
}

/// Sets a quantity of a body in a document of `job`: in its scene, or in what the captures of one
/// scene of their own lay over it.
void set_in_scenes(const fit::Address& at, double value, const Job& job, Json& document) {
  if (at.capture.empty()) {
    set_quantity(document.at("scene"), at, value);
    return;
  }
  for (const SceneGroup& group : scene_groups(job)) {
    const auto is_named = [&](std::size_t c) { return job.captures[c].name == at.capture; };
    if (std::ranges::none_of(group.captures, is_named)) continue;
    for (const std::size_t c : group.captures) {
      set_quantity(document.at("captures").at(job.captures[c].place).at("scene"), at, value);
    }
  }
}

/// Gives the numbers of `document`, which was read as `fitted`, the priors that the fit had.
void keep_priors(const FitDoc& given, const FitDoc& fitted, Json& document) {
  for (std::size_t k = 0; k < fitted.parameters.size(); ++k) {
    Json prior = prior_of(given, fitted.parameters[k].path);
    if (prior.is_object()) document.at("fit").at("parameters").at(k)["prior"] = std::move(prior);
  }
}

/// A number of a material that the recording does not identify goes back to where the fit began:
/// there the search has followed what it could not explain, to an end at which nothing moves or no
/// step is small enough. `document` was read as `fitted`, and its numbers are `estimates`.
void forget_the_unidentified(const Json& estimates, const Job& fitted, Json& document,
                             std::vector<std::string>& statements) {
  for (std::size_t k = 0; k < fitted.fit->parameters.size(); ++k) {
    const Json& parameter = estimates.at(k);
    const fit::Address& at = fitted.fit->parameters[k].path;
    const fit::Quantity& row = *at.quantity;
    if (row.member == nullptr || parameter.at("observable") != false) continue;
    const double start = parameter.at("start").get<double>();
    set_in_scenes(at, start, fitted, document);
    Json& entry = document.at("fit").at("parameters").at(k);
    entry["bounds"] = narrowed(start, entry.at("bounds"));
    statements.push_back(fmt::format(
        "The recording does not identify {}: causes are sought with its start, {:.3g}{}{}, and it "
        "is fitted again with each of them.",
        row.words, start, row.unit.empty() ? "" : " ", row.unit));
  }
}

}  // namespace

Json document_to_diagnose(const Job& job, const Fitted& fitted,
                          std::vector<std::string>& statements) {
  Json document = without_priors(job, fitted);
  ReadOptions reading;
  reading.base_folder = job.base_folder;
  const Job end = read_job(document.dump(), reading);
  keep_priors(*job.fit, *end.fit, document);
  forget_the_unidentified(fitted.fit.at("parameters"), end, document, statements);
  return document;
}

}  // namespace matterfit::job
