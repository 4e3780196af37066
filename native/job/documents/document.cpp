// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/document.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "base/file.hpp"
#include "job/documents/document_reading.hpp"
#include "job/documents/file_keys.hpp"
#include "job/documents/fit_document.hpp"
#include "job/documents/images_document.hpp"
#include "job/documents/override.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kTaskNames[] = {"simulate", "fit",    "diagnose", "compare",
                                           "bake",     "render", "check"};

std::string rewritten(const std::string& text, const fs::path& base, const fs::path& folder) {
  const fs::path absolute = (base / text).lexically_normal();
  if (folder.empty()) return absolute.generic_string();
  const fs::path relative = absolute.lexically_relative(folder.lexically_normal());
  return (relative.empty() ? absolute : relative).generic_string();
}

void rewrite_paths(Json& json, const fs::path& base, const fs::path& folder) {
  if (json.is_array()) {
    for (Json& item : json) rewrite_paths(item, base, folder);
    return;
  }
  if (!json.is_object()) return;
  for (auto& [key, value] : json.items()) {
    if (key == "holdout" || key == "fit" || key == "diagnose") continue;
    if (file_key(key, value) != FileKey::kNone) {
      value = rewritten(value.get<std::string>(), base, folder);
    } else if (value.is_array() && !value.empty() && file_key(key, value[0]) != FileKey::kNone) {
      for (Json& item : value) item = rewritten(item.get<std::string>(), base, folder);
    } else {
      rewrite_paths(value, base, folder);
    }
  }
}

}  // namespace

std::string_view task_name(Task task) { return kTaskNames[static_cast<std::size_t>(task)]; }

Task task_from_name(std::string_view name) {
  std::string known;
  for (std::size_t i = 0; i < std::size(kTaskNames); ++i) {
    if (name == kTaskNames[i]) return static_cast<Task>(i);
    known += (i == 0 ? "" : ", ") + std::string(kTaskNames[i]);
  }
  throw_input("task is \"" + std::string(name) + "\", expected one of " + known + ".");
}

fs::path ReadContext::file(const JsonValue& value) const {
  const std::string text = value.string();
  if (text.empty() || text.find('\0') != std::string::npos) value.fail("the name of a file");
  return (base_folder / text).lexically_normal();
}

const BodyDoc& body_named(const SceneDoc& scene, const std::string& name) {
  for (const BodyDoc& body : scene.bodies) {
    if (body.name == name) return body;
  }
  throw_input("there is no body '" + name + "' in the scene.");
}

void migrate(Json& document) {
  if (!document.is_object()) throw_input("the job document is not an object { … }.");
  const auto schema = document.find("schema");
  if (schema == document.end() || !schema->is_string()) {
    throw_input("schema is missing; write \"schema\": \"" + std::string(kSchema) + "\".");
  }
  const std::string& name = schema->get_ref<const std::string&>();
  // The first schema: older ones will be brought up to it here, one version at a time.
  if (name != kSchema) {
    throw_input("schema is \"" + name + "\"; this version reads \"" + std::string(kSchema) +
                "\". A newer Matterfit may have written the document.");
  }
}

Job read_job(std::string_view text, const ReadOptions& options) {
  Job job;
  job.base_folder =
      options.base_folder.empty() ? fs::current_path() : fs::absolute(options.base_folder);
  job.document = parse_json(text, options.name);
  migrate(job.document);
  if (options.task) job.document["task"] = task_name(*options.task);
  for (const std::string& assignment : options.overrides) apply_override(job.document, assignment);

  const ReadContext context{job.base_folder};
  JsonObject object(JsonValue(job.document, ""));
  (void)object.require("schema");
  if (const auto task = object.find("task")) {
    job.task =
        static_cast<Task>(task->choice({kTaskNames[0], kTaskNames[1], kTaskNames[2], kTaskNames[3],
                                        kTaskNames[4], kTaskNames[5], kTaskNames[6]}));
  }
  (void)object.string("note", "");
  const auto render = object.find("render");
  const bool still =
      render && job.task == Task::kRender && !read_render(*render, context).gaussians.empty();
  const auto scene = object.find("scene");
  if (!scene && !still) throw_input("'scene' is missing from the document.");
  if (scene) job.scene = read_scene(*scene, context);
  std::vector<std::string> films;
  if (const auto captures = object.find("captures"); captures && scene) {
    std::vector<std::string> names;
    for (const JsonValue& item : captures->items()) {
      std::string name;
      if (is_by_images(item)) {
        name = read_images(item, context, job.scene).name;
        films.push_back(name);
      } else {
        job.captures.push_back(read_capture(item, context, *scene, job.scene));
        job.captures.back().place = names.size();
        name = job.captures.back().name;
      }
      if (std::find(names.begin(), names.end(), name) != names.end()) {
        item.refuse("another capture is called '" + name + "' too; give one of them a 'name'.");
      }
      names.push_back(std::move(name));
    }
  }
  if (const auto probes = object.find("probes"); probes && scene) {
    for (const JsonValue& item : probes->items()) {
      job.probes.push_back(read_probe(item, context, job.scene));
      for (std::size_t i = 0; i + 1 < job.probes.size(); ++i) {
        if (job.probes[i].name == job.probes.back().name) {
          item.refuse("another probe is called '" + job.probes[i].name + "' too.");
        }
      }
    }
  }
  if (const auto fit = object.find("fit"); fit && scene) {
    job.fit = std::make_shared<const FitDoc>(read_fit(*fit, job.scene, job.captures, films));
  }
  if (const auto diagnose = object.find("diagnose")) job.diagnose = diagnose->json();
  const Json empty = Json::object();
  const auto output = object.find("output");
  job.output = read_output(output ? *output : JsonValue(empty, "output"), context, job.scene);
  object.finish();
  return job;
}

Job read_job_file(const fs::path& path, ReadOptions options) {
  const auto bytes = read_file(path, std::uint64_t{64} << 20U);
  if (options.base_folder.empty()) options.base_folder = fs::absolute(path).parent_path();
  options.name = path.filename().string();
  return read_job({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, options);
}

std::string write_job(const Job& job, const fs::path& folder) {
  Json document = job.document;
  rewrite_paths(document, job.base_folder, folder.empty() ? fs::path() : fs::absolute(folder));
  return document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace matterfit::job
