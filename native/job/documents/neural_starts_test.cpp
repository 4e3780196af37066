// SPDX-License-Identifier: GPL-3.0-or-later
// The published law in documents: the weights that the library carries, and those of a file.
#include "job/documents/neural_starts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "base/file.hpp"
#include "base/folder_for_test.hpp"
#include "base/message_for_test.hpp"
#include "job/documents/document.hpp"
#include "job/documents/safetensors.hpp"
#include "material/neural/pretrain_published.hpp"
#include "material/neural/published_file.hpp"
#include "material/neural/published_for_test.hpp"

namespace matterfit::job {
namespace {

using material::linear_published;
using testing::HasSubstr;

Json neural_document(const Json& material) {
  Json document = Json::parse(R"({
    "schema": "matterfit.job/1",
    "scene": {
      "fps": 24, "frames": [1, 11], "particle_separation": 0.05,
      "bodies": [ { "name": "dough", "source": { "sphere": { "radius": 0.2 } },
                    "density": 1000 } ] } })");
  document["scene"]["bodies"][0]["material"] = material;
  return document;
}

Job neural_job(const Json& document, const std::filesystem::path& folder) {
  ReadOptions options;
  options.base_folder = folder;
  return read_job(document.dump(), options);
}

void write_weights(const std::filesystem::path& path, const material::PublishedWeights& weights) {
  write_file(path, format_safetensors(material::published_tensors(weights)));
}

TEST(PublishedDocument, ReadsItsWeightsOfAFile) {
  const Folder folder;
  const material::PublishedWeights weights = linear_published(4e4, 3e4, 40.0);
  write_weights(folder.path / "mine.safetensors", weights);
  const Json document =
      neural_document({{"law", "neural"}, {"weights", "mine.safetensors"}, {"damping_shear", 2.0}});
  const Job job = neural_job(document, folder.path);
  const material::Material& m = job.scene.bodies[0].material;
  EXPECT_EQ(m.law, material::Law::kPublished);
  ASSERT_NE(m.published, nullptr);
  EXPECT_EQ(m.published->name, (folder.path / "mine.safetensors").generic_string());
  EXPECT_EQ(m.published->weights.elastic, weights.elastic);
  EXPECT_EQ(m.published->weights.plastic, weights.plastic);
  EXPECT_NEAR(m.mu(), 3e4, 10.0);
  EXPECT_EQ(m.damping_shear, 2.0);
}

TEST(PublishedDocument, WeightsThatAreNoneAreNamed) {
  const Folder folder;
  const auto refused = [&](const Json& material) {
    return matterfit::message_of([&] { (void)neural_job(neural_document(material), folder.path); });
  };
  EXPECT_THAT(refused({{"law", "neural"}, {"weights", "jam"}}),
              HasSubstr("there are no weights 'jam'. Use jelly, plasticine, sand, water"));
  EXPECT_THAT(refused({{"law", "neural"}, {"weights", "gone.safetensors"}}),
              HasSubstr("gone.safetensors"));
  write_weights(folder.path / "mine.safetensors", linear_published(4e4, 3e4, 40.0));
  const auto bytes = read_file(folder.path / "mine.safetensors");
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (const std::size_t size : {std::size_t{0}, std::size_t{7}, text.size() / 2}) {
    write_file(folder.path / "cut.safetensors", std::string_view(text).substr(0, size));
    EXPECT_THAT(refused({{"law", "neural"}, {"weights", "cut.safetensors"}}),
                HasSubstr("cut.safetensors"));
  }
  write_file(folder.path / "cut.pt", std::string_view(text).substr(0, 400));
  EXPECT_THAT(refused({{"law", "neural"}, {"weights", "cut.pt"}}),
              HasSubstr("cut.pt: is no PyTorch file"));
  write_file(folder.path / "other.safetensors",
             format_safetensors(start_tensors(*neural_start("jelly"))));
  EXPECT_THAT(refused({{"law", "neural"}, {"weights", "other.safetensors"}}),
              HasSubstr("tensor 'elastic.0' is missing"));
  write_weights(folder.path / "soft.safetensors", linear_published(0.0, 0.0, 40.0));
  EXPECT_THAT(refused({{"law", "neural"}, {"weights", "soft.safetensors"}}),
              HasSubstr("hold no body together"));
  EXPECT_THAT(refused({{"law", "neural"}, {"weights", "mine.safetensors"}, {"E", 1e5}}),
              HasSubstr("the law neural does not use 'E'"));
  EXPECT_THAT(refused({{"law", "neural_isotropic"}, {"weights", "mine.safetensors"}}),
              HasSubstr("isotropic"));
}

TEST(PublishedDocument, HasTheShippedWeightsByName) {
  const material::Material jelly =
      neural_job(neural_document({{"law", "neural"}}), {}).scene.bodies[0].material;
  EXPECT_EQ(jelly.published, published_start("jelly"));
  const material::Material sand =
      neural_job(neural_document({{"law", "neural"}, {"weights", "sand"}}), {})
          .scene.bodies[0]
          .material;
  EXPECT_EQ(sand.published, published_start("sand"));
}

/// On other samples than they were regressed to.
TEST(PublishedDocument, ShippedWeightsAreThoseOfTheirClassicalLaws) {
  Arena arena(2);
  for (const material::StartLaw law : material::kStartLaws) {
    const std::string name(start_law_name(law));
    const material::Material classical = start_material(law);
    const auto start = published_start(name);
    const material::PublishedAccuracy found =
        published_accuracy(start->weights, classical, 31, arena);
    for (std::size_t i = 0; i < found.uniaxial.size(); ++i) {
      EXPECT_LT(std::abs(found.uniaxial[i]), 0.01) << name << ", stretch " << found.kStretches[i];
    }
    EXPECT_LT(found.flow, 0.2 * found.flow_step + 1e-12) << name;
    if (classical.traits().fluid) continue;  // has no modulus against shear
    EXPECT_NEAR(start->youngs_modulus, classical.youngs_modulus, 0.01 * classical.youngs_modulus);
    EXPECT_NEAR(start->poisson_ratio, classical.poisson_ratio, 0.01);
  }
}

TEST(PublishedDocument, NoFitLooksForIt) {
  const Folder folder;
  Json document = neural_document({{"law", "neo_hookean"}, {"E", 1e5}, {"nu", 0.3}});
  document["captures"] = {{{"name", "a"}, {"tracks", "a.npz"}}};
  document["fit"] = {{"parameters", {"material.E"}}, {"laws", {"neo_hookean", "neural"}}};
  EXPECT_THAT(matterfit::message_of([&] { (void)neural_job(document, folder.path); }),
              HasSubstr("the law neural has no numbers that could be fitted"));
}

}  // namespace
}  // namespace matterfit::job
