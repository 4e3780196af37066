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
Json job_around(const Json& material) {
  return {{"schema", kSchema},
          {"task", "simulate"},
          {"scene",
           {{"fps", 24},
            {"frames", {0, 1}},
            {"particle_separation", 0.1},
            {"bodies",
             {{{"name", "material"},
               {"density", 1000},
               {"source", {{"box", {{"low", {0, 0, 0}}, {"high", {1, 1, 1}}}}}},
               {"material", material}}}}}}};
}

}  // namespace

std::vector<NamedMaterial> materials_of_file(const std::filesystem::path& file) {
  const auto bytes = read_file(file, kLargestFile);
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  const Json json = Json::parse(text, text + bytes.size(), nullptr, false);
  const bool scene = json.is_object() && json.contains("scene");
  if (!scene && !(json.is_object() && json.contains("material"))) {
    throw_input(file.generic_string() +
                " is no job document (it has no 'scene') and no material (it has no 'material'). "
                "Give the scene.json or material.json of a fit.");
  }
  ReadOptions options;
  options.base_folder = std::filesystem::absolute(file).parent_path();
  options.name = file.filename().string();
  if (scene) options.task = Task::kSimulate;
  const Job job = read_job(scene ? json.dump() : job_around(json.at("material")).dump(), options);
  std::vector<NamedMaterial> materials;
  for (const BodyDoc& body : job.scene.bodies) {
    materials.push_back({scene ? body.name : file.stem().string(), body.material});
  }
  return materials;
}

}  // namespace matterfit::job
