// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/pretrain_files.hpp"

#include <algorithm>
#include <functional>
#include <thread>
#include <utility>

#include "base/clock.hpp"
#include "base/error.hpp"
#include "base/file.hpp"
#include "base/parallel.hpp"
#include "base/side_by_side.hpp"
#include "job/documents/neural_starts.hpp"
#include "job/documents/safetensors.hpp"
#include "job/documents/tests_document.hpp"
#include "job/fit_laws.hpp"
#include "job/material_file.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/machine_tests.hpp"
#include "material/neural/pretrain.hpp"
#include "material/neural/pretrain_latent.hpp"
#include "material/neural/pretrain_published.hpp"
#include "material/neural/published_file.hpp"

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

/// At which tests are compared; the law of a rubber does not feel it [1/s].
constexpr double kTestRate = 1.0;

/// Classical materials of a class that the latent law's accuracy is measured on.
constexpr std::size_t kOfEachClass = 60;

/// What a file of weights that the library carries says of itself.
auto shipped_metadata(const char* law, const std::string& name, const std::string& pretrained_on,
                      const Json& accuracy, const PretrainOptions& options, const char* source) {
  return decltype(Tensors::metadata){{"law", law},
                                     {"name", name},
                                     {"pretrained_on", pretrained_on},
                                     {"seed", std::to_string(options.seed)},
                                     {"accuracy", accuracy.dump()},
                                     {"version", MATTERFIT_VERSION},
                                     {"licence", "CC0-1.0"},
                                     {"source", source}};
}

Json write_latent(const PretrainOptions& options, Arena& arena) {
  material::LatentPretraining training;
  training.seed = options.seed;
  const auto decoder = pretrain_latent(training, arena);
  Json classes = Json::object();
  for (const material::LatentAccuracy& one :
       latent_accuracy(decoder, kOfEachClass, options.seed + kAccuracySeed, arena)) {
    classes[std::string(one.name)] = {
        {"stress_rms", one.stress},   {"stress_rms_95", one.stress_worst},
        {"yield_log_rms", one.yield}, {"yield_log_rms_95", one.yield_worst},
        {"rate_log_rms", one.rate},   {"of_class", one.of_class}};
  }
  Tensors tensors = latent_tensors(*decoder);
  tensors.metadata =
      shipped_metadata("latent", "latent", "all classical laws over the ranges of their numbers",
                       classes, options, "matterfit pretrain --latent");
  write_file(options.folder / "latent.safetensors", format_safetensors(tensors));
  return classes;
}

Json write_published(const std::string& name, const material::Material& classical,
                     const PretrainOptions& options, Arena& arena) {
  material::PublishedPretraining training;
  training.seed = options.seed;
  const material::PublishedWeights weights = pretrain_published(classical, training, arena);
  const material::PublishedAccuracy found =
      published_accuracy(weights, classical, options.seed + kAccuracySeed, arena);
  Json uniaxial = Json::object();
  Json worst = Json::object();
  for (std::size_t i = 0; i < found.uniaxial.size(); ++i) {
    const std::string stretch = Json(material::PublishedAccuracy::kStretches[i]).dump();
    uniaxial[stretch] = found.uniaxial[i];
    worst[stretch] = found.uniaxial_worst[i];
  }
  Json accuracy = {
      {"uniaxial", uniaxial},   {"uniaxial_worst", worst},          {"stress_rms", found.stress},
      {"flow_rms", found.flow}, {"flow_step_rms", found.flow_step}, {"creep_rms", found.creep}};
  Tensors tensors = material::published_tensors(weights);
  tensors.metadata = shipped_metadata("neural", name, material_json(classical).dump(), accuracy,
                                      options, "matterfit pretrain --published");
  const std::string file = std::string(kPublishedPrefix) + name + ".safetensors";
  write_file(options.folder / file, format_safetensors(tensors));
  return accuracy;
}

/// R² of each test, and of the neo-Hookean of shear modulus `shear`.
Json test_agreement(const std::vector<material::MachineTest>& tests, const material::Material& law,
                    double shear, double poisson_ratio) {
  material::Material plain;
  plain.law = material::Law::kNeoHookean;
  plain.youngs_modulus = 2.0 * (1.0 + poisson_ratio) * shear;
  plain.poisson_ratio = poisson_ratio;
  Json list = Json::array();
  for (const material::MachineTest& test : tests) {
    const auto of = [&](const material::Material& material) {
      std::vector<double> nominal;
      for (const material::CurvePoint& point :
           stress_curve(material, test.pull, test.by, kTestRate)) {
        nominal.push_back(point.nominal);
      }
      return material::r_squared(nominal, test.nominal);
    };
    list.push_back(
        {{"pull", pull_name(test.pull)}, {"r_squared", of(law)}, {"neo_hookean", of(plain)}});
  }
  return list;
}

/// A law of tests; gives what it is named and how well it agrees.
std::pair<std::string, Json> write_tested(const std::filesystem::path& file,
                                          const PretrainOptions& options) {
  const TestsDoc doc = read_tests_file(file);
  const auto start = material::with_directions(
      doc.name, material::regress_machine_tests(doc.fitted, doc.poisson_ratio), options.seed);
  const material::Material law = material::isotropic_material(start);
  const double shear = material::neo_hookean_of_tests(doc.fitted);
  const Json report = {{"E", law.youngs_modulus},
                       {"nu", law.poisson_ratio},
                       {"fitted", test_agreement(doc.fitted, law, shear, doc.poisson_ratio)},
                       {"held_out", test_agreement(doc.held_out, law, shear, doc.poisson_ratio)}};
  Tensors tensors = start_tensors(*start);
  tensors.metadata = {{"law", "neural_isotropic"},    {"name", doc.name},
                      {"pretrained_on", doc.source},  {"accuracy", report.dump()},
                      {"version", MATTERFIT_VERSION}, {"source", "matterfit pretrain --tests"}};
  write_file(options.folder / (doc.name + ".safetensors"), format_safetensors(tensors));
  return {doc.name, report};
}

Json write_isotropic(const std::string& name, const material::Material& classical,
                     const PretrainOptions& options, Arena& arena) {
  material::Pretraining training;
  training.seed = options.seed;
  const material::IsotropicWeights weights = pretrain_isotropic(classical, training);
  Json accuracy =
      accuracy_json(material::accuracy(weights, classical, options.seed + kAccuracySeed, arena));
  Tensors tensors = start_tensors(*material::with_directions(name, weights, options.seed));
  tensors.metadata = shipped_metadata("neural_isotropic", name, material_json(classical).dump(),
                                      accuracy, options, "matterfit pretrain");
  write_file(options.folder / (name + ".safetensors"), format_safetensors(tensors));
  return accuracy;
}

/// A file that is to be made; gives its entry of the report.
struct Wanted {
  std::string name;
  std::function<Json(Arena&)> make;
};

/// Makes all, the first ones first; each entry says what it took where there are several.
Json made(const std::vector<Wanted>& wanted, int threads) {
  if (threads < 1) threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  std::vector<Json> entries(wanted.size());
  const auto at_once = std::max<std::size_t>(1, wanted.size());
  side_by_side(wanted.size(), at_once, threads,
               [&](std::size_t task, const std::shared_ptr<Arena>& arena) {
                 const auto start = Clock::now();
                 entries[task] = wanted[task].make(*arena);
                 if (wanted.size() > 1) entries[task]["seconds"] = seconds_since(start);
               });
  Json report = Json::object();
  for (std::size_t k = 0; k < wanted.size(); ++k) report[wanted[k].name] = std::move(entries[k]);
  return report;
}

}  // namespace

Json write_start_laws(const PretrainOptions& options) {
  const bool chosen = !options.laws.empty() || !options.materials.empty() ||
                      !options.tests.empty() || options.published || options.latent;
  if (options.all && chosen) {
    throw_input("pretrain: --all makes what the library carries, and takes no other choice.");
  }
  std::vector<NamedMaterial> classical;
  const auto add = [&](material::StartLaw law) {
    classical.push_back(
        {std::string(material::start_law_name(law)), material::start_material(law), {}});
  };
  for (const std::string& name : options.laws) add(material::start_law_from_name(name));
  for (const std::filesystem::path& file : options.materials) {
    for (NamedMaterial& one : materials_of_file(file)) {
      if (material::is_isotropic(one.material.law) || one.material.published) {
        throw_input(file.generic_string() + ": '" + one.name +
                    "' is of the neural law already; its weights are a start as they are.");
      }
      classical.push_back(std::move(one));
    }
  }
  // The decoder alone is made where nothing else is named; of the published law it is all or some.
  const bool none = classical.empty() && options.tests.empty();
  if (none && (options.published || !options.latent)) {
    for (const material::StartLaw law : material::kStartLaws) add(law);
  }
  std::vector<Wanted> wanted;
  // What takes longest begins first.
  if (options.latent || options.all) {
    wanted.push_back({"latent", [&](Arena& arena) { return write_latent(options, arena); }});
  }
  for (const NamedMaterial& one : classical) {
    const auto name = options.all ? std::string(kPublishedPrefix) + one.name : one.name;
    if (!options.published && !options.all) continue;
    wanted.push_back({name, [&](Arena& arena) {
                        return write_published(one.name, one.material, options, arena);
                      }});
  }
  for (const NamedMaterial& one : classical) {
    if (options.published) continue;
    wanted.push_back({one.name, [&](Arena& arena) {
                        return write_isotropic(one.name, one.material, options, arena);
                      }});
  }
  Json report = made(wanted, options.threads);
  for (const std::filesystem::path& file : options.tests) {
    const auto [name, agreed] = write_tested(file, options);
    report[name] = agreed;
  }
  return report;
}

}  // namespace matterfit::job
