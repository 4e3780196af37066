// SPDX-License-Identifier: GPL-3.0-or-later
// Fits to masks that move all weights of a neural law.
#include <gtest/gtest.h>

#include <string>

#include "job/clip_for_test.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;

Json weights_fit(const Json& material, const fs::path& folder) {
  Json truth = thrown_cube();
  truth["scene"]["bodies"][0]["material"] = material;
  truth["scene"]["bodies"][0]["formulation"] = "updated";
  film(truth, folder, two_cameras());
  Json document = truth;
  document["task"] = "fit";
  document["captures"] = Json::array({{{"cameras", "clip/transforms.json"}, {"noise", 0.3}}});
  document["captures"][0]["holdout"] = {{"frames", {11, 14}}};
  return document;
}

/// With the truth's own throw, so that all that is to be found is the material.
TEST(ImageWeights, OfThePublishedLawFromMasksPredictHeldOutFrames) {
  const Folder folder;
  Json document = weights_fit({{"law", "neo_hookean"}, {"E", 3e4}, {"nu", 0.4}}, folder.path);
  document["scene"]["bodies"][0]["material"] = {{"law", "neural"}};
  document["fit"] = {{"weights", 4}, {"parameters", Json::array()}};
  const Json result = run(document, folder.path);
  const Json& fit = result.at("fit");
  const Json& weights = fit.at("weights");
  testing::Test::RecordProperty("summary", weights.dump());
  EXPECT_TRUE(weights.at("taken").get<bool>()) << fit.dump(1);
  const Json& held = weights.at("held_out_iou");
  const double apart = 1.0 - held.at("with").get<double>();
  EXPECT_LT(apart, 0.8 * (1.0 - held.at("without").get<double>())) << weights;
  // What the folder holds is what was found, in the substeps of the new weights.
  EXPECT_NEAR(fit.at("silhouettes").at("after").at("held_out").at("iou").get<double>(),
              held.at("with").get<double>(), 0.02);
  EXPECT_TRUE(fs::exists(folder.path / "out/weights_cube.safetensors"));
  const auto bytes = read_file(folder.path / "out/scene.json");
  Json fitted = Json::parse(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  EXPECT_EQ(fitted["scene"]["bodies"][0]["material"]["weights"], "weights_cube.safetensors");
}

// The numbers as they were before weights were moved, with and without any.
TEST(ImageWeights, CancelledTheNumbersAreHandedOut) {
  for (const Json& parameters : {Json::array(), Json{"velocity"}}) {
    const Folder folder;
    Json document = weights_fit({{"law", "neo_hookean"}, {"E", 3e4}, {"nu", 0.4}}, folder.path);
    document["scene"]["bodies"][0]["material"] = {{"law", "neural"}};
    document["fit"] = {{"weights", 4}, {"parameters", parameters}, {"iterations", 2}};
    const Json result = cancelled_at(document, folder.path, {"Fitting: weights"});
    ASSERT_EQ(result.at("status"), "cancelled") << result;
    const Json& fit = result.at("fit");
    ASSERT_EQ(fit.at("parameters").size(), 3 * parameters.size());
    for (const Json& number : fit.at("parameters")) EXPECT_TRUE(number.at("value").is_number());
    const auto bytes = read_file(folder.path / "out/scene.json");
    const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    EXPECT_FALSE(Json::parse(text)["scene"]["bodies"][0]["material"].contains("weights"));
  }
}

TEST(ImageWeights, OfTheIsotropicLawBesideItsModulus) {
  const Folder folder;
  Json document = weights_fit({{"law", "neo_hookean"}, {"E", 3e4}, {"nu", 0.4}}, folder.path);
  document["scene"]["bodies"][0]["material"] = {{"law", "neural_isotropic"}, {"E", 5e4}};
  document["scene"]["bodies"][0]["formulation"] = "auto";
  document["fit"] = {{"weights", 2},
                     {"parameters", {{{"path", "material.E"}, {"start", 5e4}}}},
                     {"iterations", 3}};
  const Json fit = run(document, folder.path).at("fit");
  const Json& weights = fit.at("weights");
  testing::Test::RecordProperty("summary", weights.dump());
  EXPECT_EQ(weights.at("body"), "cube");
  EXPECT_GE(weights.at("iterations").get<int>(), 1);
  const Json& held = weights.at("held_out_iou");
  EXPECT_GE(held.at("with").get<double>(), held.at("without").get<double>());
  EXPECT_EQ(fs::exists(folder.path / "out/weights_cube.safetensors"),
            weights.at("taken").get<bool>());
}

}  // namespace
}  // namespace matterfit::job
