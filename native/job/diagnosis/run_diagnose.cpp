// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/run_diagnose.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/file.hpp"
#include "diagnose/diagnose.hpp"
#include "job/diagnosis/fitted_document.hpp"
#include "job/diagnosis/page.hpp"
#include "job/diagnosis/report_json.hpp"
#include "job/diagnosis/scene_model.hpp"
#include "job/diagnosis/swapped_tracks.hpp"
#include "job/documents/fit_document.hpp"
#include "job/documents/inputs.hpp"
#include "job/fit_files.hpp"
#include "job/fit_run.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/stage.hpp"

namespace matterfit::job {
namespace {

/// Share of the whole that the fit takes.
constexpr double kDiagnosedFitShare = 0.3;

/// Particles times substeps of all searches together, some minutes of two cores, after which they
/// end; but not before so many simulations.
constexpr double kMostWork = 1.8e9;
constexpr int kFewestSimulations = 400;
constexpr int kMostSimulations = 1'000'000;

/// What the section `diagnose` of a document asks for.
struct Settings {
  diagnose::DiagnoseOptions engine;
  int particles = 1500;  ///< of all bodies together, with which causes are sought; about
  int runs = 0;          ///< DiagnoseOptions::most_runs; 0: as many as kMostWork allows
  bool shooting = true;  ///< SceneModel
  std::vector<std::string> ignored;  ///< effects that nobody believes
};

Settings read_settings(const Json& given) {
  Settings settings;
  diagnose::DiagnoseOptions& options = settings.engine;
  // Derivatives to one side are as good as the ranking needs, at half the runs.
  options.central = false;
  if (given.is_null()) return settings;
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
    } else if (key == "particles") {
      settings.particles = whole(key, value, 100, 10'000'000);
    } else if (key == "runs") {
      settings.runs = whole(key, value, 100, kMostSimulations);
    } else if (key == "central") {
      if (!value.is_boolean()) throw_input("diagnose.central: expected true or false.");
      options.central = value.get<bool>();
    } else if (key == "shooting") {
      if (!value.is_boolean()) throw_input("diagnose.shooting: expected true or false.");
      settings.shooting = value.get<bool>();
    } else if (key == "ignored") {
      if (!value.is_array() || !std::ranges::all_of(value, &Json::is_string)) {
        throw_input("diagnose.ignored: expected a list of names of causes.");
      }
      settings.ignored = value.get<std::vector<std::string>>();
    } else {
      throw_input("diagnose: unknown key '" + key +
                  "'. Known: members, refits, most_causes, seed, central, particles, runs, "
                  "shooting, ignored.");
    }
  }
  return settings;
}

/// Gives a document's scene, and those that captures have of their own, `factor` times the particle
/// separation of `given`.
void set_separation(const Json& given, double factor, Json& document) {
  const auto widen = [&](const Json& from, Json& scene) {
    if (!from.contains("particle_separation")) return;
    const double separation = from.at("particle_separation").get<double>();
    scene["particle_separation"] = factor == 1.0 ? separation : factor * separation;
  };
  widen(given.at("scene"), document.at("scene"));
  for (std::size_t c = 0; c < given.at("captures").size(); ++c) {
    const Json& capture = given.at("captures").at(c);
    if (capture.contains("scene")) {
      widen(capture.at("scene"), document.at("captures").at(c).at("scene"));
    }
  }
}

/// How much farther apart particles may be for about so many; 1: it has no more.
double coarsening_of(const Job& job, int particles, const Interrupter& interrupter) {
  Arena arena(1);
  const mpm::Scene scene = build_scene(job, arena, interrupter).scene;
  double count = 0.0;
  for (const mpm::Body& body : scene.bodies) count += double(body.rest.size());
  const double factor = std::cbrt(count / double(particles));
  // A third more is not worth another scene.
  return factor > 1.1 ? factor : 1.0;
}

Job read_again(const Job& job, const Json& document) {
  ReadOptions reading;
  reading.base_folder = job.base_folder;
  return read_job(document.dump(), reading);
}

/// The job with tracks that were taken for each other put right.
Job without_swaps(const Job& job, const std::vector<SwappedTracks>& swapped) {
  Json document = job.document;
  write_swaps(swapped, document);
  return read_again(job, document);
}

/// Probes are looked at in the job's own scene.
Job without_probes(Job job) {
  job.probes.clear();
  return job;
}

/// The job with fewer particles, in which causes are sought.
Job coarse_job(const Job& job, double factor) {
  Json document = job.document;
  set_separation(job.document, factor, document);
  return without_probes(read_again(job, document));
}

}  // namespace

Json run_diagnose(const Job& given, const RunOptions& options, Interrupter& interrupter) {
  if (!given.fit) {
    throw_input(
        "fit: a diagnosis says what a fitted model gets wrong; add a section 'fit' with the "
        "parameters that are to be found first.");
  }
  if (given.fit->loss != FitDoc::Loss::kTracks) {
    throw_input("fit.loss: a diagnosis needs tracks; clouds without correspondence have none.");
  }
  Settings settings = read_settings(given.diagnose);
  const std::vector<SwappedTracks> swapped = find_swapped_tracks(given);
  const Job job = swapped.empty() ? given : without_swaps(given, swapped);
  const std::filesystem::path folder = job.output.folder;
  const double factor = coarsening_of(job, settings.particles, interrupter);
  // A fit that was done at the job's own resolution is not done again.
  std::optional<Fitted> fitted = read_fitted(folder);
  const bool known =
      fitted && options.restart != Restart::kAlways &&
      fitted->input_hash == hash_inputs(fit_inputs(job, resolve_target(options.target)));
  std::vector<std::string> statements;
  if (!known) {
    Job fitting = factor > 1.0 ? coarse_job(job, factor) : job;
    fitting.task = Task::kFit;
    Json fit = run_fit(fitting, options, interrupter);
    if (fit.value("status", "") == "cancelled") return fit;
    fitted = read_fitted(folder);
    if (!fitted) throw_compute(folder.string() + ": the fit left no fit/fitted.json there.");
    set_separation(job.document, 1.0, fitted->document);
  }

  const Json document = document_to_diagnose(job, *fitted, statements);
  Json sought = document;
  if (factor > 1.0) {
    set_separation(job.document, factor, sought);
    statements.push_back(fmt::format(
        "Causes were sought with particles {:.3g} times as far apart as the scene's.", factor));
  }
  const Job base = without_probes(read_again(job, sought));
  SceneModel model(base, SceneModel::From::kDocument, options, interrupter, statements,
                   settings.shooting);
  std::vector<double> before;
  for (const Json& parameter : fitted->fit.at("parameters")) {
    before.push_back(parameter.at("start").get<double>());
  }
  model.begin_also_from(std::move(before));
  const MotionStore store(folder / "diagnosis",
                          hash_inputs(fit_inputs(base, resolve_target(options.target))));
  model.keep_in(&store);
  settings.engine.most_runs = settings.runs;
  if (settings.runs == 0) {
    const double affordable = kMostWork / std::max(1.0, model.work());
    settings.engine.most_runs =
        std::max(kFewestSimulations, int(std::min(double(kMostSimulations), affordable)));
  }
  settings.engine.progress = [&](double part, const std::string& what) {
    enter_stage(interrupter, "Diagnosing: " + what,
                kDiagnosedFitShare + (1.0 - kDiagnosedFitShare) * part);
  };
  const diagnose::Report report = diagnose::diagnose(model, settings.engine);

  if (report.began_elsewhere) {
    statements.push_back(
        "The fit had ended far off, so causes were sought from the throw that the first flight of "
        "the recording shows, and the values of the fit are not the report's.");
  }
  if (report.cut) {
    statements.push_back(
        fmt::format("The search for causes ended after {} simulations, before it was done: what is "
                    "named may be missing something. \"diagnose\": {{\"runs\": {}}}, in the panel "
                    "Limit Runs, looks longer.",
                    report.runs, std::min(kMostSimulations, 3 * settings.engine.most_runs)));
  }
  Json json = report_json(report, model.captures());
  report_swaps(swapped, json);
  for (Json& cause : json.at("causes")) {
    if (std::ranges::count(settings.ignored, cause.at("effect").get<std::string>()) > 0) {
      cause["ignored"] = true;
    }
  }
  json["status"] = "done";
  json["task"] = "diagnose";
  json["version"] = MATTERFIT_VERSION;
  json["folder"] = folder.generic_string();
  json["fit"] = fitted->fit;
  if (!report.extended.causes.empty() || !swapped.empty()) {
    diagnose::Point point;
    point.theta = report.extended.theta;
    for (const diagnose::Active& active : report.extended.causes) {
      point.causes.push_back({active.effect, active.variant, active.values});
    }
    Json extended = document;
    extended.erase("fit");
    extended["task"] = "simulate";
    model.write(point, extended, statements);
    json["model"] = extended.at("scene");
    json["model_captures"] = extended.at("captures");
    write_file(folder / "extended.json", extended.dump(2) + "\n");
  }
  json["statements"] = statements;
  write_file(folder / "diagnosis.json", json.dump(2) + "\n");
  write_file(folder / "diagnosis.html", report_page(json));
  store.clear();
  return json;
}

}  // namespace matterfit::job
