// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_files.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "base/file.hpp"
#include "job/documents/manifest.hpp"
#include "job/fit_checkpoint.hpp"
#include "job/fit_report.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFittedSchema = "matterfit.fit/1";
constexpr const char* kMaterialSchema = "matterfit.material/1";

std::string text_of(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

/// Whether a fit wrote the file: a material with its provenance.
bool is_fitted_material(const fs::path& path) {
  const auto bytes = read_file(path);
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  const Json json = Json::parse(text, text + bytes.size(), nullptr, false);
  return json.is_object() && json.contains("provenance") && json.contains("schema") &&
         json["schema"] == kMaterialSchema;
}

void remove_others(const fs::path& folder, const std::vector<std::string>& files) {
  std::vector<fs::path> stale;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_regular_file() || name.rfind("material_", 0) != 0 ||
        entry.path().extension() != ".json" ||
        std::find(files.begin(), files.end(), name) != files.end()) {
      continue;
    }
    if (is_fitted_material(entry.path())) stale.push_back(entry.path());
  }
  for (const fs::path& path : stale) {
    std::error_code code;
    fs::remove(path, code);
  }
}

/// The inputs of a checkpoint of any kind of fit; nothing where it is missing or damaged.
std::optional<Inputs> unfinished_inputs(const fs::path& folder) {
  const Json file = read_checkpoint(folder);
  try {
    return file.at("state").at("inputs").get<Inputs>();
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

}  // namespace

Json document_to_simulate(const Job& job, const fs::path& folder) {
  Json document = job.document;
  document["task"] = "simulate";
  document["output"]["folder"] = folder.generic_string();
  document.erase("fit");
  return document;
}

std::vector<std::string> fitted_bodies(const FitDoc& fit, const std::string& otherwise) {
  std::vector<std::string> bodies;
  const auto add = [&](const std::string& name) {
    if (std::find(bodies.begin(), bodies.end(), name) == bodies.end()) bodies.push_back(name);
  };
  if (!fit.laws.empty()) add(fit.body);
  for (const fit::ParameterSpec& parameter : fit.parameters) {
    if (parameter.path.quantity->is_material()) add(parameter.path.owner);
  }
  if (bodies.empty()) add(otherwise);
  return bodies;
}

void write_fitted(const fs::path& folder, const Fitted& fitted) {
  write_file(folder / kFittedPath, text_of({{"schema", kFittedSchema},
                                            {"input_hash", fitted.input_hash},
                                            {"inputs", fitted.inputs},
                                            {"document", fitted.document},
                                            {"fit", fitted.fit}}));
}

std::optional<Fitted> read_fitted(const fs::path& folder) {
  if (!fs::exists(folder / kFittedPath)) return std::nullopt;
  const auto bytes = read_file(folder / kFittedPath);
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  const Json json = Json::parse(text, text + bytes.size(), nullptr, false);
  try {
    if (json.at("schema") != kFittedSchema) return std::nullopt;
    return Fitted{json.at("input_hash"), json.at("inputs"), json.at("document"), json.at("fit")};
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

void refuse_what_is_there(const fs::path& folder, const Inputs& now) {
  constexpr const char* kWayOut =
      "\nRun with --restart to replace them, or choose another output folder (--set "
      "output.folder=…).";
  const auto refuse = [&](const std::string& what, const Inputs& before) {
    std::string text = folder.string() + " holds " + what + " of other inputs. What changed:";
    for (const std::string& line : changes(before, now)) text += "\n  " + line;
    throw_input(text + kWayOut);
  };
  if (const auto unfinished = unfinished_inputs(folder)) refuse("an unfinished fit", *unfinished);
  if (const auto fitted = read_fitted(folder)) refuse("a fit", fitted->inputs);
  const auto manifest = read_manifest(folder);
  if (!manifest || manifest->frames_done == 0) return;
  throw_input(folder.string() + " holds the results of the task " + manifest->task +
              ", which the fit would replace." + kWayOut);
}

void write_history(const fs::path& folder, const std::vector<Json>& history) {
  std::string text;
  for (const Json& line : history) {
    text += line.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  }
  write_file(folder / kFitHistoryPath, text);
}

std::vector<std::string> write_materials(const fs::path& folder, const Job& fitted,
                                         const std::vector<std::string>& bodies, const Json& fit) {
  std::vector<std::string> files = {"scene.json"};
  write_file(folder / files.front(), write_job(fitted, folder));
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    files.push_back(k == 0 ? "material.json" : "material_" + bodies[k] + ".json");
    write_file(folder / files.back(), text_of(material_preset(fitted, bodies[k], fit)));
  }
  remove_others(folder, files);
  return files;
}

Json write_unfinished(const Unfinished& of, Json fit, const Error& why) {
  (void)write_materials(of.folder, of.fitted, of.bodies, fit);
  Json result = {{"status", why.kind() == ErrorKind::kCancelled ? "cancelled" : "failed"},
                 {"task", "fit"},
                 {"error", why.what()},
                 {"exit_status", exit_status(why.kind())},
                 {"version", MATTERFIT_VERSION},
                 {"target", target_name(of.target)},
                 {"folder", of.folder.string()},
                 {"fit", std::move(fit)}};
  write_file(of.folder / "result.json",
             result.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  return result;
}

Json run_or_unfinished(const Unfinished& of, const Json& fit, const std::function<Json()>& run) {
  try {
    return run();
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::kCancelled) return write_unfinished(of, fit, error);
    if (error.kind() != ErrorKind::kCompute) throw;
    (void)write_unfinished(of, fit, error);
    throw_compute("The fit is done, and its values are in " + of.folder.generic_string() +
                  "/result.json, but the fitted scene could not be simulated: " + error.what());
  }
}

}  // namespace matterfit::job
