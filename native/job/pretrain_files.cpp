// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/pretrain_files.hpp"

#include "base/file.hpp"
#include "base/parallel.hpp"
#include "job/documents/safetensors.hpp"
#include "job/fit_laws.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/pretrain.hpp"

namespace matterfit::job {
namespace {

/// Samples of the accuracy are others than those of the regression.
constexpr std::uint64_t kAccuracySeed = 1000;

Json accuracy_json(const material::LawAccuracy& found) {
  Json uniaxial = Json::object();
  for (std::size_t i = 0; i < found.uniaxial.size(); ++i) {
    uniaxial[Json(material::LawAccuracy::kStretches[i]).dump()] = found.uniaxial[i];
  }
  return {{"uniaxial", uniaxial},
          {"stress_rms", found.stress},
          {"flow_rms", found.flow},
          {"flow_step_rms", found.flow_step}};
}

}  // namespace

Json write_start_laws(const PretrainOptions& options) {
  std::vector<material::StartLaw> laws;
  laws.reserve(material::kStartLaws.size());
  for (const std::string& name : options.laws) {
    laws.push_back(material::start_law_from_name(name));
  }
  if (laws.empty()) laws.assign(material::kStartLaws.begin(), material::kStartLaws.end());
  Arena arena(1);
  Json report = Json::object();
  for (const material::StartLaw law : laws) {
    const std::string name(material::start_law_name(law));
    const material::Material classical = material::start_material(law);
    material::Pretraining training;
    training.seed = options.seed;
    const material::IsotropicWeights weights = pretrain_isotropic(classical, training);
    const Json accuracy =
        accuracy_json(material::accuracy(weights, classical, options.seed + kAccuracySeed, arena));
    Tensors tensors = start_tensors(*material::with_directions(name, weights, options.seed));
    tensors.metadata = {{"law", "neural_isotropic"},
                        {"name", name},
                        {"pretrained_on", material_json(classical).dump()},
                        {"seed", std::to_string(options.seed)},
                        {"accuracy", accuracy.dump()},
                        {"version", MATTERFIT_VERSION},
                        {"licence", "CC0-1.0"},
                        {"source", "matterfit pretrain"}};
    write_file(options.folder / (name + ".safetensors"), format_safetensors(tensors));
    report[name] = accuracy;
  }
  return report;
}

}  // namespace matterfit::job
