// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/material_file.hpp"

#include <utility>

#include "base/error.hpp"
#include "base/file.hpp"
#include "job/documents/document.hpp"

namespace matterfit::job {
namespace {

constexpr std::uint64_t kLargestFile = std::uint64_t{64} << 20U;

/// A job of one body, for a material without one.
Json job_around(const Json& document) {
  Json job = {{"schema", kSchema},
              {"task", "simulate"},
              {"scene",
               {{"fps", 24},
                {"frames", {0, 1}},
                {"particle_separation", 0.1},
                {"bodies",
                 {{{"name", "material"},
                   {"density", 1000},
                   {"source", {{"box", {{"low", {0, 0, 0}}, {"high", {1, 1, 1}}}}}},
                   {"material", document.at("material")}}}}}}};
  if (document.contains("excited")) {
    job["scene"]["bodies"][0]["excited"] = document.at("excited");
  }
  return job;
}

}  // namespace

std::vector<NamedMaterial> materials_of_file(const std::filesystem::path& file) {
  const auto bytes = read_file(file, kLargestFile);
  return materials_of_text({reinterpret_cast<const char*>(bytes.data()), bytes.size()},
                           std::filesystem::absolute(file).parent_path(), file.generic_string(),
                           file.stem().string());
}

std::vector<NamedMaterial> materials_of_text(std::string_view text,
                                             const std::filesystem::path& folder,
                                             const std::string& name, const std::string& alone) {
  const Json json = Json::parse(text, nullptr, false);
  const bool scene = json.is_object() && json.contains("scene");
  if (!scene && !(json.is_object() && json.contains("material"))) {
    throw_input(name +
                " is no job document (it has no 'scene') and no material (it has no 'material'). "
                "Give the scene.json or material.json of a fit.");
  }
  ReadOptions options;
  options.base_folder = folder;
  options.name = name;
  if (scene) options.task = Task::kSimulate;
  const Job job = read_job(scene ? json.dump() : job_around(json).dump(), options);
  std::vector<NamedMaterial> materials;
  for (const BodyDoc& body : job.scene.bodies) {
    materials.push_back({scene ? body.name : alone, body.material, body.excited});
  }
  return materials;
}

}  // namespace matterfit::job
