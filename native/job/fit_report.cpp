// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "fit/data/metrics.hpp"
#include "fit/model/capture_problem.hpp"
#include "job/documents/excitation_document.hpp"
#include "job/documents/images_document.hpp"
#include "job/fit_laws.hpp"
#include "job/run/compare.hpp"

namespace matterfit::job {
namespace {

Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(); }

/// The share of the held-out error that each further number of a law has to take off: a yield
/// stress that is never reached predicts as well as none, and a rounding better.
constexpr double kGainOfNumber = 0.02;

/// What the rank of a model is by: the logarithm of its weight.
double weight_of(const Json& model) {
  const bool held = model.at("held_out_mm").is_number();
  const double mean = model.at(held ? "held_out_mm" : "fitted_mm").get<double>();
  const double frames = model.at("frames").get<double>();
  const double parameters = double(model.at("parameters").size());
  const double penalty =
      held ? frames * std::log1p(kGainOfNumber) : 0.5 * std::log(std::max(1.0, frames));
  return -frames * std::log(std::max(mean, 1e-12)) - parameters * penalty;
}

/// A candidate with its entry of FitState::models.
struct Candidate {
  const fit::LawState& law;
  const Json& model;

  [[nodiscard]] bool usable() const {
    return law.failed.empty() && model.is_object() && model.at("fitted_mm").is_number();
  }
  [[nodiscard]] double log_weight() const {
    return usable() ? weight_of(model) : -std::numeric_limits<double>::infinity();
  }
};

}  // namespace

void ErrorPool::add(const fit::Capture& capture, const std::vector<double>& error_mm,
                    double body_size) {
  const std::size_t points = capture.input.tracks.points;
  for (std::size_t t = 0; t < capture.input.tracks.frames(); ++t) {
    bool any[2] = {false, false};
    for (std::size_t i = 0; i < points; ++i) {
      const std::size_t at = t * points + i;
      const double error = error_mm[at];
      if (!std::isfinite(error) || (capture.used[at] == 0 && capture.predicted[at] == 0)) continue;
      const std::size_t which = capture.predicted[at];
      errors_[which].push_back(error);
      percents_[which].push_back(0.1 * error / body_size);
      any[which] = true;
    }
    for (std::size_t which = 0; which < 2; ++which) frames_[which] += any[which] ? 1 : 0;
  }
}

void ErrorPool::add(const std::vector<double>& distances, double body_size, std::size_t frames,
                    bool held_out) {
  const std::size_t which = held_out ? 1 : 0;
  for (const double distance : distances) {
    errors_[which].push_back(1e3 * distance);
    percents_[which].push_back(100.0 * distance / body_size);
  }
  frames_[which] += frames;
}

Json ErrorPool::json() const {
  const auto one = [&](std::size_t which) -> Json {
    if (errors_[which].empty()) return {};
    Json json = error_statistics(errors_[which]);
    json.erase("max_mm");
    double sum = 0.0;
    for (const double percent : percents_[which]) sum += percent;
    json["mean_percent"] = sum / double(percents_[which].size());
    return json;
  };
  return {{"fitted", one(0)}, {"held_out", one(1)}};
}

std::optional<double> ErrorPool::mean(bool held_out) const {
  const std::vector<double>& errors = errors_[held_out ? 1 : 0];
  if (errors.empty()) return std::nullopt;
  double sum = 0.0;
  for (const double error : errors) sum += error;
  return sum / double(errors.size());
}

namespace {

double size_of(const mpm::Scene& scene, const fit::Capture& capture) {
  const mpm::Body& body = scene.bodies[fit::body_index(scene, capture.input.body)];
  return fit::body_size(body.rest) + 0.5 * scene.dx;
}

/// Errors of clouds: of each capture alone, first of what is used, then of what is held out.
ErrorPool cloud_errors(const std::vector<fit::Run>& runs, const fit::Model& model, fit::Loss loss,
                       const fit::Outcome& outcome) {
  ErrorPool pool;
  fit::Window whole;
  fit::Mask none(runs.size());
  for (std::size_t r = 0; r < runs.size(); ++r) {
    whole.until.push_back(runs[r].captures.empty() ? -1.0
                                                   : std::numeric_limits<double>::infinity());
    none[r].resize(runs[r].captures.size(), nullptr);
  }
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (std::size_t c = 0; c < runs[r].captures.size(); ++c) {
      const fit::Capture& capture = runs[r].captures[c];
      for (const bool held_out : {false, true}) {
        fit::Mask mask = none;
        mask[r][c] = held_out ? &capture.predicted : &capture.used;
        const fit::CaptureProblem problem(model, runs, {}, loss, whole, mask);
        pool.add(problem.distances(problem.residuals(outcome)), size_of(model.scene(r), capture),
                 capture.frames_in(*mask[r][c]).size(), held_out);
      }
    }
  }
  return pool;
}

}  // namespace

ErrorPool errors_of(const std::vector<fit::Run>& runs, const fit::Model& model, FitDoc::Loss loss,
                    const fit::Outcome& outcome) {
  if (loss != FitDoc::Loss::kTracks) return cloud_errors(runs, model, loss, outcome);
  ErrorPool pool;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (std::size_t c = 0; c < outcome[r].captures.size(); ++c) {
      const fit::Capture& capture = runs[r].captures[c];
      pool.add(capture, capture_error_mm(capture.input, outcome[r].captures[c]),
               size_of(model.scene(r), capture));
    }
  }
  return pool;
}

Json parameters_json(const std::vector<fit::Parameter>& parameters,
                     const std::vector<double>& values,
                     const std::optional<fit::Uncertainty>& uncertainty) {
  Json list = Json::array();
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const fit::Parameter& parameter = parameters[k];
    Json json = {{"path", parameter.name},
                 {"unit", parameter.unit},
                 {"start", parameter.start},
                 {"value", values[k]},
                 {"standard_error", nullptr},
                 {"grid_error", nullptr},
                 {"interval", nullptr},
                 {"bounds", {parameter.low, parameter.high}},
                 {"at_bound", values[k] <= parameter.low || values[k] >= parameter.high},
                 {"observable", nullptr},
                 {"statement", ""}};
    if (uncertainty) {
      const fit::Estimate& estimate = uncertainty->estimates[k];
      json["standard_error"] = finite(estimate.standard_error);
      if (estimate.grid_error > 0.0) json["grid_error"] = finite(estimate.grid_error);
      if (std::isfinite(estimate.standard_error)) {
        json["interval"] = {finite(estimate.low), finite(estimate.high)};
      }
      json["at_bound"] = estimate.at_bound;
      json["observable"] = estimate.observable;
      json["statement"] = estimate.statement;
    }
    list.push_back(std::move(json));
  }
  return list;
}

Json correlation_json(const fit::Uncertainty& uncertainty) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < uncertainty.correlation.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < uncertainty.correlation.cols(); ++j) {
      row.push_back(finite(uncertainty.correlation(i, j)));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

std::optional<ErrorPool> errors_of(fit::LawFit& fit, const fit::LawState& state, bool fitted,
                                   std::string& failure) {
  const auto outcome = fit.predict(state, fitted, failure);
  if (!outcome) return std::nullopt;
  return errors_of(fit.runs(), fit.model(), fit.loss(), *outcome);
}

void advance(fit::LawFit& fit, fit::LawState& state, std::vector<Json>& history) {
  std::vector<fit::SearchStep> steps;
  fit.advance(state, steps);
  const std::vector<fit::Parameter>& parameters = fit.parameters().parameters();
  for (const fit::SearchStep& step : steps) {
    Json values;
    for (std::size_t p = 0; p < step.values.size(); ++p) {
      values[parameters[p].name] = step.values[p];
    }
    history.push_back({{"stage", step.stage},
                       {"law", step.law},
                       {"iteration", step.iteration},
                       {"cost", step.cost},
                       {"rms_mm", finite(1e3 * step.rms)},
                       {"accepted", step.accepted},
                       {"evaluations", step.evaluations},
                       {"values", values}});
  }
}

Json ranked_models(const std::vector<fit::LawState>& laws, const std::vector<Json>& models) {
  std::vector<Candidate> order;
  order.reserve(laws.size());
  for (std::size_t k = 0; k < laws.size(); ++k) order.push_back({laws[k], models[k]});
  std::vector<const Candidate*> ranked;
  ranked.reserve(order.size());
  for (const Candidate& one : order) ranked.push_back(&one);
  std::ranges::stable_sort(ranked, [](const Candidate* a, const Candidate* b) {
    return a->log_weight() > b->log_weight();
  });
  const double best = ranked.empty() ? 0.0 : ranked.front()->log_weight();
  double sum = 0.0;
  for (const Candidate* one : ranked) {
    if (one->usable()) sum += std::exp(one->log_weight() - best);
  }
  Json list = Json::array();
  for (const Candidate* one : ranked) {
    Json json = one->model.is_object() ? one->model : Json::object();
    json.erase("frames");
    json["law"] = one->law.law;
    json["failed"] = one->law.failed;
    json["reason"] = one->law.reason();
    json["left"] = one->law.left();
    json["probability"] = one->usable() ? Json(std::exp(one->log_weight() - best) / sum) : Json();
    for (const char* key : {"held_out_mm", "fitted_mm", "parameters"}) {
      if (!json.contains(key)) json[key] = nullptr;
    }
    list.push_back(std::move(json));
  }
  return list;
}

std::string fit_warning(const Json& fit, bool far) {
  std::string warning;
  if (fit.at("converged") == false) {
    warning = "The search did not end at a minimum: " + fit.at("reason").get<std::string>() +
              " Begin from other values, or raise fit.iterations.";
  }
  const Json& noise = fit.at("noise_scale");
  if (far) {
    warning += fmt::format(
        "{}The fitted simulation misses the capture by {}{}: the search may have ended in a wrong "
        "place (begin from other values), or the law or the scene lacks something.",
        warning.empty() ? "" : " ",
        fit.value("loss", "tracks") == "tracks" ? "far more than its noise"
                                                : "more than another sampling would",
        noise.is_number() ? fmt::format(" ({:.3g} times that)", noise.get<double>()) : "");
  }
  return warning;
}

std::string held_out_warning(const Json& after) {
  constexpr double kMuchWorse = 10.0;
  constexpr double kLarge = 10.0;  // % of the body
  const Json& fitted = after.at("fitted");
  const Json& held = after.at("held_out");
  if (!fitted.is_object() || !held.is_object()) return "";
  const auto mean = [](const Json& errors) { return errors.at("mean_mm").get<double>(); };
  const double percent = held.at("mean_percent").get<double>();
  if (percent < kLarge || mean(held) < kMuchWorse * mean(fitted)) return "";
  return fmt::format(
      "What was held out is missed by {:.3g} mm ({:.3g} % of the body), what was fitted by {:.3g} "
      "mm: the one does not predict the other. Fit more frames, or look for what the scene lacks.",
      mean(held), percent, mean(fitted));
}

Json material_preset(const Job& fitted, const std::string& body, const Json& fit) {
  const BodyDoc& doc = body_named(fitted.scene, body);
  Json captures = Json::array();
  std::string names;
  for (const CaptureDoc& capture : fitted.captures) {
    const bool seen = !capture.holdout.capture;
    captures.push_back({{"name", capture.name},
                        {"file", capture.file.filename().string()},
                        {"body", capture.body},
                        {"held_out", !seen}});
    if (seen) names += (names.empty() ? "" : ", ") + capture.name;
  }
  for (const ImagesDoc& images : images_of(fitted)) {
    captures.push_back({{"name", images.name},
                        {"file", images.cameras.filename().string()},
                        {"body", images.body},
                        {"held_out", false}});
    names += (names.empty() ? "" : ", ") + images.name;
  }
  Json parameters = Json::array();
  for (const Json& parameter : fit.at("parameters")) {
    Json kept;
    for (const char* key :
         {"path", "unit", "value", "standard_error", "grid_error", "interval", "observable"}) {
      kept[key] = parameter.at(key);
    }
    parameters.push_back(std::move(kept));
  }
  Json preset = {{"schema", "matterfit.material/1"},
                 {"name", body + ", fitted"},
                 {"density", doc.density},
                 {"material", material_json(doc.material)},
                 {"source", "Fitted with Matterfit " MATTERFIT_VERSION " to " + names + "."},
                 {"provenance",
                  {{"version", MATTERFIT_VERSION},
                   {"captures", captures},
                   {"converged", fit.at("converged")},
                   {"warning", fit.value("warning", "")},
                   {"parameters", parameters},
                   {"correlation", fit.at("correlation")},
                   {"noise_scale", fit.at("noise_scale")},
                   {"fitted", fit.at("after").at("fitted")},
                   {"held_out", fit.at("after").at("held_out")},
                   {"particle_separation", fitted.scene.particle_separation},
                   {"statements", fit.at("statements")}}}};
  if (doc.excited) preset["excited"] = excitation_json(*doc.excited);
  return preset;
}

}  // namespace matterfit::job
