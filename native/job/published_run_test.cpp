// SPDX-License-Identifier: GPL-3.0-or-later
// A job with the published law: simulated, gone on with, written as a material and drawn as curves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "base/file.hpp"
#include "base/folder_for_test.hpp"
#include "job/curves.hpp"
#include "job/documents/inputs.hpp"
#include "job/documents/neural_starts.hpp"
#include "job/documents/safetensors.hpp"
#include "job/fit_laws.hpp"
#include "job/run_job.hpp"
#include "material/neural/published_file.hpp"
#include "material/neural/published_for_test.hpp"

namespace matterfit::job {
namespace {

Json published_cube() {
  return Json::parse(R"({ "schema": "matterfit.job/1", "task": "simulate",
    "scene": { "fps": 24, "frames": [1, 9], "particle_separation": 0.05,
      "bodies": [ { "name": "cube", "density": 1000, "velocity": [1, 0, -2],
        "source": { "box": { "low": [0,0,0.1], "high": [0.4,0.4,0.5] } },
        "material": { "law": "neural", "weights": "mine.safetensors" } } ],
      "colliders": [ { "name": "ground", "shape": "ground" } ] },
    "output": { "checkpoint": { "frames": 3 } } })");
}

void write_noisy_weights(const std::filesystem::path& folder) {
  write_file(folder / "mine.safetensors", format_safetensors(material::published_tensors(
                                              material::noisy_published(4e4, 3e4, 40.0, 0.1, 5))));
}

Json run_published(const Json& document, const std::filesystem::path& folder, int threads) {
  ReadOptions read;
  read.base_folder = folder;
  RunOptions options;
  options.threads = threads;
  Interrupter interrupter;
  return run_job(read_job(document.dump(), read), options, interrupter);
}

TEST(PublishedRun, SimulatesWithTheSameHashForAnyThreads) {
  std::string hash;
  for (const int threads : {1, 2}) {
    const Folder folder;
    write_noisy_weights(folder.path);
    const Json result = run_published(published_cube(), folder.path, threads);
    EXPECT_EQ(result["status"], "done");
    EXPECT_EQ(result["particles"], 512);
    const std::string found = result["result_hash"];
    if (hash.empty()) hash = found;
    EXPECT_EQ(found, hash);
  }
}

/// What is in the file counts, whatever its name.
TEST(PublishedRun, OtherWeightsAreAnotherInput) {
  const Folder folder;
  ReadOptions read;
  read.base_folder = folder.path;
  const auto inputs = [&] {
    return simulation_inputs(read_job(published_cube().dump(), read), mpm::SimdTarget::kAuto);
  };
  write_noisy_weights(folder.path);
  const Inputs before = inputs();
  EXPECT_EQ(inputs(), before);
  write_file(
      folder.path / "mine.safetensors",
      format_safetensors(material::published_tensors(material::linear_published(4e4, 3e4, 40.0))));
  EXPECT_NE(inputs(), before);
}

TEST(PublishedRun, AMaterialGoesThroughItsDocument) {
  const Folder folder;
  write_noisy_weights(folder.path);
  ReadOptions read;
  read.base_folder = folder.path;
  const Job job = read_job(published_cube().dump(), read);
  const material::Material& m = job.scene.bodies[0].material;
  const Json written = material_json(m);
  EXPECT_EQ(written.size(), 2U) << written;
  Json again = published_cube();
  again["scene"]["bodies"][0]["material"] = written;
  const Job other = read_job(again.dump(), read);
  EXPECT_EQ(other.scene.bodies[0].material.published->weights.elastic,
            m.published->weights.elastic);
  // A law of its moduli, where a fit looks for another law.
  const material::Material elastic = with_law(m, material::Law::kNeoHookean);
  EXPECT_EQ(elastic.published, nullptr);
  EXPECT_EQ(elastic.youngs_modulus, m.youngs_modulus);
  material::validate(elastic, "elastic");
}

TEST(PublishedRun, ItsCurvesAreThoseOfItsWeights) {
  const Folder folder;
  write_noisy_weights(folder.path);
  const Json document = {{"schema", "matterfit.material/1"},
                         {"name", "noisy"},
                         {"material", {{"law", "neural"}, {"weights", "mine.safetensors"}}},
                         {"source", "a test"},
                         {"density", 1000}};
  CurveOptions options;
  options.strain = 0.1;
  const Json own = curves_of_text(document.dump(), folder.path, options).at("material");
  const Json theirs = curves_of_file(folder.path / "mine.safetensors", options).at("mine");
  EXPECT_EQ(own.at("curves"), theirs.at("curves"));
  EXPECT_EQ(own.at("rate"), theirs.at("rate"));
}

}  // namespace
}  // namespace matterfit::job
