// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/inputs.hpp"

#include <hwy/targets.h>

#include <algorithm>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/hash.hpp"
#include "capture/image_clip.hpp"
#include "capture/tracks.hpp"
#include "job/documents/file_keys.hpp"
#include "job/documents/images_document.hpp"
#include "job/fit_sources.hpp"
#include "job/solver_sources.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

/// Lists longer than this are compared as a whole.
constexpr std::size_t kLongList = 24;

bool names_a_file(const std::string& key, const Json& value) {
  return file_key(key, value) == FileKey::kSimulated;
}

std::string file_hash(const fs::path& path) {
  const auto bytes = read_file(path);
  return "content " + hash_hex({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

/// 1 and 1.0 are the same input.
std::string leaf(const Json& json) {
  return json.is_number() ? Json(json.get<double>()).dump() : json.dump();
}

struct Flattening {
  Inputs inputs;
  fs::path base;

  void add(const Json& json, const std::string& path, const std::string& key) {
    if (names_a_file(key, json)) {
      inputs[path] = file_hash((base / json.get<std::string>()).lexically_normal());
    } else if (json.is_object()) {
      if (json.empty()) inputs[path] = "{}";
      for (const auto& [name, value] : json.items()) {
        if (!value.is_null()) add(value, path + "." + name, name);
      }
    } else if (json.is_array()) {
      const bool files = !json.empty() && names_a_file(key, json[0]);
      if (json.size() > kLongList && !files) {
        Flattening inside{{}, base};
        for (std::size_t i = 0; i < json.size(); ++i) inside.add(json[i], std::to_string(i), "");
        inputs[path] = "list of " + std::to_string(json.size()) + ", " + hash_inputs(inside.inputs);
        return;
      }
      if (json.empty()) inputs[path] = "[]";
      for (std::size_t i = 0; i < json.size(); ++i) {
        add(json[i], path + "[" + std::to_string(i) + "]", files ? key : "");
      }
    } else {
      inputs[path] = leaf(json);
    }
  }
};

void require_named(const Json& json, const std::string& path, const std::string& key,
                   const fs::path& base) {
  if (json.is_object()) {
    for (const auto& [name, value] : json.items()) {
      require_named(value, path.empty() ? name : path + "." + name, name, base);
    }
  } else if (json.is_array()) {
    for (std::size_t i = 0; i < json.size(); ++i) {
      require_named(json[i], path + "[" + std::to_string(i) + "]", key, base);
    }
  } else if (names_a_file(key, json)) {
    const fs::path file = (base / json.get<std::string>()).lexically_normal();
    if (fs::is_directory(file)) {
      throw_input(path + ": " + file.string() + " is a folder. Name a file.");
    }
    if (!fs::is_regular_file(file)) {
      throw_input(path + ": the file " + file.string() +
                  " does not exist. Put it back, or name another one.");
    }
  }
}

}  // namespace

Inputs simulation_inputs(const Job& job, mpm::SimdTarget target) {
  Json scene = job.document.at("scene");
  scene.erase("quality");
  if (scene.contains("solver") && scene["solver"].is_object()) {
    scene["solver"].erase("memory_limit_gb");
    if (scene["solver"].empty()) scene.erase("solver");
  }
  for (const char* list : {"colliders", "contacts", "effects"}) {
    if (scene.contains(list) && scene[list].empty()) scene.erase(list);
  }
  // What a body was seen at says something about a run and nothing to it.
  for (Json& body : scene.at("bodies")) body.erase("excited");
  Flattening flattening{{}, job.base_folder};
  flattening.add(scene, "scene", "scene");
  flattening.inputs["version"] = std::string(MATTERFIT_VERSION) + ", code " + kSolverSources;
  flattening.inputs["target"] = target_name(target);
  return flattening.inputs;
}

Inputs capture_inputs(const Job& job) {
  Flattening flattening{{}, job.base_folder};
  for (std::size_t i = 0; i < job.captures.size(); ++i) {
    Json capture = job.document.at("captures").at(job.captures[i].place);
    const fs::path& file = job.captures[i].file;
    Hasher content;
    if (fs::is_regular_file(file) && file.extension() != ".ply") {
      content.add(file_hash(file));
    } else {
      for (const fs::path& one : capture::find_sequence(file).paths) content.add(file_hash(one));
    }
    capture["tracks"] = "content " + content.hex();
    flattening.add(capture, "captures[" + std::to_string(i) + "]", "");
  }
  for (const ImagesDoc& images : images_of(job)) {
    flattening.add(job.document.at("captures").at(images.place), images.path, "");
    Hasher content;
    try {
      for (const fs::path& file : capture::image_clip_files(images.cameras, images.options)) {
        content.add(fs::is_regular_file(file) ? file_hash(file) : "not there");
      }
    } catch (const Error& error) {
      throw Error(error.kind(), images.path + ": " + error.what());
    }
    flattening.inputs[images.path + ".content"] = "content " + content.hex();
  }
  return flattening.inputs;
}

Inputs fit_inputs(const Job& job, mpm::SimdTarget target) {
  Inputs inputs = simulation_inputs(job, target);
  inputs.merge(capture_inputs(job));
  Flattening flattening{{}, job.base_folder};
  flattening.add(job.document.at("fit"), "fit", "");
  inputs.insert(flattening.inputs.begin(), flattening.inputs.end());
  inputs["version"] += std::string(", fit ") + kFitSources;
  return inputs;
}

Inputs output_inputs(const Job& job) {
  Flattening flattening{{}, job.base_folder};
  if (job.document.contains("output")) {
    Json output = job.document["output"];
    for (const char* key : {"folder", "report", "checkpoint", "bake"}) output.erase(key);
    flattening.add(output, "output", "output");
    flattening.inputs["version"] = MATTERFIT_VERSION;
  }
  return flattening.inputs;
}

void require_files(const Job& job) {
  require_named(job.document, "", "", job.base_folder);
  for (const CaptureDoc& capture : job.captures) {
    try {
      (void)capture::find_sequence(capture.file);
    } catch (const Error& error) {
      throw Error(error.kind(),
                  "captures[" + std::to_string(capture.place) + "].tracks: " + error.what());
    }
  }
}

std::string hash_inputs(const Inputs& inputs) {
  Hasher hasher;
  for (const auto& [path, value] : inputs) {
    hasher.add(path).add("\n").add(value).add("\n");
  }
  return hasher.hex();
}

std::vector<std::string> changes(const Inputs& before, const Inputs& now, std::size_t limit) {
  std::vector<std::string> lines;
  const auto shortened = [](const std::string& value) {
    if (value.rfind("content ", 0) == 0) return std::string("another content");
    if (value.rfind("list of ", 0) == 0) return value.substr(0, value.find(','));
    return value;
  };
  for (const auto& [path, value] : now) {
    const auto old = before.find(path);
    if (old == before.end()) {
      lines.push_back(path + ": " + shortened(value) + ", was not there");
    } else if (old->second != value) {
      const bool whole = value.rfind("content ", 0) == 0 || value.rfind("list of ", 0) == 0;
      lines.push_back(whole ? path + ": its content"
                            : path + ": " + shortened(value) + ", was " + shortened(old->second));
    }
  }
  for (const auto& [path, value] : before) {
    if (now.find(path) == now.end()) lines.push_back(path + ": gone, was " + shortened(value));
  }
  if (lines.size() > limit) {
    const std::size_t more = lines.size() - limit;
    lines.resize(limit);
    lines.push_back("… and " + std::to_string(more) + " more");
  }
  return lines;
}

mpm::SimdTarget resolve_target(mpm::SimdTarget target) {
  if (target != mpm::SimdTarget::kAuto) return target;
  const std::int64_t supported = hwy::SupportedTargets() & HWY_TARGETS;
  if ((supported & HWY_AVX3) != 0) return mpm::SimdTarget::kAvx512;
  if ((supported & HWY_AVX2) != 0) return mpm::SimdTarget::kAvx2;
  return mpm::SimdTarget::kSse4;
}

std::string target_name(mpm::SimdTarget target) {
  switch (resolve_target(target)) {
    case mpm::SimdTarget::kAvx512:
      return "avx512";
    case mpm::SimdTarget::kAvx2:
      return "avx2";
    default:
      return "sse4";
  }
}

mpm::SimdTarget target_from_name(const std::string& name) {
  const std::int64_t supported = hwy::SupportedTargets() & HWY_TARGETS;
  const auto checked = [&](mpm::SimdTarget target, std::int64_t bit) {
    if ((supported & bit) == 0) {
      throw_input("target " + name + ": this machine's processor does not have it; it has " +
                  target_name(mpm::SimdTarget::kAuto) + ".");
    }
    return target;
  };
  if (name.empty() || name == "auto") return mpm::SimdTarget::kAuto;
  if (name == "sse4") return checked(mpm::SimdTarget::kSse4, HWY_SSE4);
  if (name == "avx2") return checked(mpm::SimdTarget::kAvx2, HWY_AVX2);
  if (name == "avx512") return checked(mpm::SimdTarget::kAvx512, HWY_AVX3);
  throw_input("target is \"" + name + "\", expected auto, sse4, avx2 or avx512.");
}

}  // namespace matterfit::job
