// SPDX-License-Identifier: GPL-3.0-or-later
// Fits that move all weights of the published law.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "base/file.hpp"
#include "base/message_for_test.hpp"
#include "job/documents/neural_starts.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "material/neural/published_material.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using testing::HasSubstr;

/// A clip of the fixture's cube of another material, and a fit that begins with shipped weights.
struct PublishedClip {
  explicit PublishedClip(const Json& material) {
    truth = thrown_cube();
    truth["scene"]["bodies"][0]["material"] = material;
    truth["scene"]["bodies"][0]["formulation"] = "updated";
    record(truth, folder.path, "a", 1);
    document = fit_of(truth, {});
    document["scene"]["bodies"][0]["material"] = {{"law", "neural"}};
    document["captures"][0]["holdout"] = {{"frames", {11, 14}}};
    document["fit"]["levels"] = {1};
    document["fit"]["weights"] = 6;
  }
  Json run() { return fit_test::run(document, folder.path); }
  [[nodiscard]] Json read(const char* name) const {
    const auto bytes = read_file(folder.path / "out" / name);
    return Json::parse(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  }

  Folder folder;
  Json truth;
  Json document;
};

double mean_of(const Json& result, const char* when, const char* what) {
  return result["fit"][when][what]["mean_mm"].get<double>();
}

TEST(FitPublished, AllWeightsFromTheShippedJellyPredictBetter) {
  PublishedClip clip({{"law", "neo_hookean"}, {"E", 3e4}, {"nu", 0.4}});
  const Json result = clip.run();
  const Json& weights = result["fit"]["weights"];
  const double without = weights["held_out_mm"]["without"].get<double>();
  const double with = weights["held_out_mm"]["with"].get<double>();
  testing::Test::RecordProperty("summary", weights.dump());
  EXPECT_TRUE(weights["taken"].get<bool>()) << weights;
  EXPECT_LT(with, 0.5 * without);
  EXPECT_LT(mean_of(result, "after", "held_out"), 1.05 * with);
  const std::string named = clip.read("scene.json")["scene"]["bodies"][0]["material"]["weights"];
  EXPECT_EQ(named, "weights_cube.safetensors");
  const std::string file = clip.read("material.json")["material"]["weights"];
  EXPECT_TRUE(fs::equivalent(file, clip.folder.path / "out" / named));
  EXPECT_NE(read_published_file(file)->weights.elastic, published_start("jelly")->weights.elastic);
  // Another throw with them, which nothing chose among.
  clip.truth["scene"]["bodies"][0]["velocity"] = {-0.4, 0.9, -2.2};
  record(clip.truth, clip.folder.path, "b", 2);
  const auto missed = [&](const Json& material) {
    Json other = clip.truth;
    other["scene"]["bodies"][0]["material"] = material;
    other["captures"] = {{{"name", "b"}, {"tracks", "b.npz"}}};
    other["task"] = "compare";
    other["output"]["folder"] = "again_" + std::to_string(material.contains("weights"));
    return fit_test::run(other, clip.folder.path)["compare"]["captures"][0]["mean_mm"]
        .get<double>();
  };
  EXPECT_LT(missed({{"law", "neural"}, {"weights", file}}), 0.6 * missed({{"law", "neural"}}));
}

TEST(FitPublished, WeightsOneByOneAreRefused) {
  Json document = fit_of(thrown_cube(), {"material.weight_moves[0]"});
  document["scene"]["bodies"][0]["material"] = {{"law", "neural"}};
  EXPECT_THAT(message_of([&] { (void)job_of(document, {}); }), HasSubstr("give fit.weights"));
  document["fit"] = {{"parameters", Json::array()}};
  EXPECT_THAT(message_of([&] { (void)job_of(document, {}); }), HasSubstr("at least one parameter"));
}

}  // namespace
}  // namespace matterfit::job
