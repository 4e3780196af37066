// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/run_diagnose.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.hpp"
#include "base/file.hpp"
#include "diagnose/diagnose.hpp"
#include "job/diagnosis/page.hpp"
#include "job/diagnosis/report_json.hpp"
#include "job/diagnosis/scene_model.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fit_files.hpp"
#include "job/fit_run.hpp"

namespace matterfit::job {
namespace {

/// Share of the whole that the fit takes.
constexpr double kFitShare = 0.3;

/// The section `diagnose` of a document.
diagnose::DiagnoseOptions read_options(const Json& given) {
  diagnose::DiagnoseOptions options;
  if (given.is_null()) return options;
  if (!given.is_object()) throw_input("diagnose: expected an object.");
  const auto whole = [](const std::string& key, const Json& value, int least, int most) {
    if (!value.is_number_integer() || value.get<long long>() < least ||
        value.get<long long>() > most) {
      throw_input(fmt::format("diagnose.{} is {}, expected a whole number from {} to {}.", key,
                              value.dump(), least, most));
    }
    return value.get<int>();
  };
  for (const auto& [key, value] : given.items()) {
    if (key == "members") {
      options.members = whole(key, value, 0, 200);
    } else if (key == "refits") {
      options.refits = whole(key, value, 1, 40);
    } else if (key == "most_causes") {
      options.most_causes = whole(key, value, 1, 6);
    } else if (key == "seed") {
      options.seed = static_cast<std::uint64_t>(whole(key, value, 0, 1 << 30));
    } else if (key == "central") {
      if (!value.is_boolean()) throw_input("diagnose.central: expected true or false.");
      options.central = value.get<bool>();
    } else {
      throw_input("diagnose: unknown key '" + key +
                  "'. Known: members, refits, most_causes, seed, central.");
    }
  }
  return options;
}

/// The entry of the document's list that has this parameter's prior; null:
/// none.
Json prior_of(const Json& entries, const std::string& path) {
  for (const Json& entry : entries) {
    if (!entry.is_object() || !entry.contains("prior")) continue;
    const std::string given = entry.at("path").get<std::string>();
    if (path.size() >= given.size() && path.ends_with(given)) return entry.at("prior");
  }
  return {};
}

/// The fitted scene as a job whose parameters start where the fit ended.
Json fitted_document(const Job& job, const Fitted& fitted) {
  Json document = fitted.document;
  document["task"] = "diagnose";
  document["output"] = job.document.value("output", Json::object());
  Json entries = Json::array();
  const Json& given = job.document.at("fit").at("parameters");
  for (const Json& parameter : fitted.fit.at("parameters")) {
    const std::string path = parameter.at("path").get<std::string>();
    Json entry = {{"path", path}, {"bounds", parameter.at("bounds")}};
    if (Json prior = prior_of(given, path); prior.is_object()) entry["prior"] = std::move(prior);
    entries.push_back(std::move(entry));
  }
  document["fit"] = {{"parameters", std::move(entries)}};
  return document;
}

}  // namespace

Json run_diagnose(const Job& job, const RunOptions& options, Interrupter& interrupter) {
  if (!job.fit) {
    throw_input(
        "fit: a diagnosis says what a fitted model gets wrong; add a "
        "section 'fit' with the "
        "parameters that are to be found first.");
  }
  if (job.fit->loss != FitDoc::Loss::kTracks) {
    throw_input(
        "fit.loss: a diagnosis needs tracks; clouds without "
        "correspondence have none.");
  }
  diagnose::DiagnoseOptions settings = read_options(job.diagnose);
  Job fitting = job;
  fitting.task = Task::kFit;
  const Json fit = run_fit(fitting, options, interrupter);
  if (fit.value("status", "") == "cancelled") return fit;
  const std::filesystem::path folder = job.output.folder;
  const auto fitted = read_fitted(folder);
  if (!fitted) throw_compute(folder.string() + ": the fit left no fit/fitted.json there.");

  ReadOptions reading;
  reading.base_folder = job.base_folder;
  const Json document = fitted_document(job, *fitted);
  const Job base = read_job(document.dump(), reading);
  std::vector<std::string> statements;
  SceneModel model(base, options, interrupter, statements);
  settings.progress = [&](double part, const std::string& what) {
    Progress progress;
    progress.label = "Diagnosing: " + what;
    progress.fraction = kFitShare + (1.0 - kFitShare) * part;
    interrupter.report(progress);
    interrupter.check();
  };
  const diagnose::Report report = diagnose::diagnose(model, settings);

  Json json = report_json(report, model.captures());
  json["status"] = "done";
  json["task"] = "diagnose";
  json["version"] = MATTERFIT_VERSION;
  json["folder"] = folder.generic_string();
  json["fit"] = fitted->fit;
  json["statements"] = statements;
  if (!report.extended.causes.empty()) {
    diagnose::Point point;
    point.theta = report.extended.theta;
    for (const diagnose::Active& active : report.extended.causes) {
      point.causes.push_back({active.effect, active.variant, active.values});
    }
    Json extended = document;
    extended.erase("fit");
    extended["task"] = "simulate";
    model.write(point, extended);
    json["model"] = extended.at("scene");
    write_file(folder / "extended.json", extended.dump(2) + "\n");
  }
  write_file(folder / "diagnosis.json", json.dump(2) + "\n");
  write_file(folder / "diagnosis.html", report_page(json));
  return json;
}

}  // namespace matterfit::job
