// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/capture_scene.hpp"

#include "base/error.hpp"
#include "job/documents/document_reading.hpp"

namespace matterfit::job {
namespace {

bool is_named_list(const std::string& key) { return key == "bodies" || key == "colliders"; }

void merge(Json& base, const Json& patch, const std::string& path);

void merge_named(Json& list, const Json& patch, const std::string& path) {
  for (std::size_t i = 0; i < patch.size(); ++i) {
    const Json& entry = patch[i];
    const std::string where = path + "[" + std::to_string(i) + "]";
    if (!entry.is_object() || !entry.contains("name") || !entry["name"].is_string()) {
      throw_input(where + ": 'name' is missing; entries merge with the scene's by their names.");
    }
    Json* same = nullptr;
    for (Json& candidate : list) {
      if (candidate.is_object() && candidate.contains("name") &&
          candidate["name"] == entry["name"]) {
        same = &candidate;
      }
    }
    if (same == nullptr) {
      list.push_back(entry);
    } else {
      merge(*same, entry, where);
    }
  }
}

void merge(Json& base, const Json& patch, const std::string& path) {
  for (const auto& [key, value] : patch.items()) {
    const std::string where = path + "." + key;
    if (value.is_null()) {
      base.erase(key);
    } else if (base.contains(key) && base[key].is_object() && value.is_object()) {
      merge(base[key], value, where);
    } else if (is_named_list(key) && base.contains(key) && base[key].is_array() &&
               value.is_array()) {
      merge_named(base[key], value, where);
    } else {
      base[key] = value;
    }
  }
}

}  // namespace

Json merged_scene(const Json& scene, const Json& overrides, const std::string& path) {
  Json merged = scene;
  merge(merged, overrides, path);
  return merged;
}

std::vector<SceneGroup> scene_groups(const Job& job) {
  std::vector<SceneGroup> groups(1);
  for (std::size_t i = 0; i < job.captures.size(); ++i) {
    const CaptureDoc& capture = job.captures[i];
    if (!capture.scene) {
      groups.front().captures.push_back(i);
      continue;
    }
    SceneGroup* same = nullptr;
    for (SceneGroup& group : groups) {
      if (!group.own) continue;
      const CaptureDoc& first = job.captures[group.captures.front()];
      if (first.scene_overrides == capture.scene_overrides) same = &group;
    }
    if (same != nullptr) {
      same->captures.push_back(i);
    } else {
      groups.push_back({{i}, true, capture.name});
    }
  }
  return groups;
}

Job group_job(const Job& job, const SceneGroup& group) {
  Json document = job.document;
  if (group.own) {
    const CaptureDoc& first = job.captures[group.captures.front()];
    document["scene"] =
        merged_scene(document.at("scene"), first.scene_overrides, first.path + ".scene");
    const auto folder = job.output.folder / "runs" / group.name;
    Json output = {{"folder", folder.generic_string()}};
    if (document.contains("output") && document["output"].contains("checkpoint")) {
      output["checkpoint"] = document["output"]["checkpoint"];
    }
    document["output"] = std::move(output);
  }
  Json captures = Json::array();
  for (const std::size_t i : group.captures) {
    Json capture = document.at("captures").at(job.captures[i].place);
    capture.erase("scene");
    // The name may have come from the file's; both must stay.
    capture["name"] = job.captures[i].name;
    captures.push_back(std::move(capture));
  }
  if (!group.own && document.contains("captures")) {
    // Images are of the document's own scene.
    for (const Json& capture : document.at("captures")) {
      if (is_by_images(JsonValue(capture, "captures"))) captures.push_back(capture);
    }
  }
  document["captures"] = std::move(captures);
  document.erase("fit");
  document.erase("diagnose");
  ReadOptions options;
  options.base_folder = job.base_folder;
  Job result = read_job(document.dump(), options);
  result.task = job.task;
  for (std::size_t k = 0; k < group.captures.size(); ++k) {
    result.captures[k].path = job.captures[group.captures[k]].path;
  }
  return result;
}

}  // namespace matterfit::job
