// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/curves.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "base/error.hpp"
#include "job/documents/excitation_document.hpp"

namespace matterfit::job {
namespace {

Json preset(const Json& material) {
  return {{"schema", "matterfit.material/1"},
          {"name", "one"},
          {"density", 1000},
          {"source", "a test"},
          {"material", material}};
}

Json only(const Json& material, const CurveOptions& options = {}) {
  return curves_of_text(preset(material).dump(), "", options).at("material");
}

TEST(Curves, OfAClassicalLawAreThoseOfItsFormula) {
  const Json found = only({{"law", "stvk_hencky"}, {"E", 1e5}, {"nu", 0.3}});
  ASSERT_EQ(found.at("curves").size(), 1U);
  EXPECT_TRUE(found.at("excited").is_null());
  EXPECT_EQ(found.at("faults").size(), 0U);
  const Json& pulled = found.at("curves")[0].at("uniaxial");
  // τ = E ε with free sides, and P = τ/λ.
  for (std::size_t k = 0; k < pulled.at("stretch").size(); ++k) {
    const double by = pulled.at("stretch")[k].get<double>();
    EXPECT_NEAR(pulled.at("nominal")[k].get<double>(), 1e5 * std::log(by) / by, 1.0);
    EXPECT_NEAR(pulled.at("across")[k].get<double>(), std::pow(by, -0.3), 1e-6);
  }
}

TEST(Curves, ANeuralLawHasTheNearestKnownOneBesideIt) {
  const Json found = only({{"law", "neural_isotropic"}, {"E", 1e5}, {"nu", 0.2}});
  ASSERT_EQ(found.at("curves").size(), 2U);
  EXPECT_EQ(found.at("curves")[1].at("what"), "nearest");
  EXPECT_EQ(found.at("curves")[1].at("law"), "fixed_corotated");
  EXPECT_LT(found.at("distance").get<double>(), 0.05);
  CurveOptions alone;
  alone.beside = false;
  EXPECT_EQ(only({{"law", "neural_isotropic"}, {"E", 1e5}, {"nu", 0.2}}, alone).at("curves").size(),
            1U);
}

TEST(Curves, ACorrectedLawIsShownWithoutItToo) {
  const Json found = only(
      {{"law", "neo_hookean"}, {"E", 1e5}, {"nu", 0.3}, {"correction", {0.0, 0.5, 0.0, 0.0, 0.0}}});
  ASSERT_EQ(found.at("curves").size(), 2U);
  EXPECT_EQ(found.at("curves")[1].at("what"), "alone");
  EXPECT_GT(found.at("curves")[0].at("uniaxial").at("nominal").back().get<double>(),
            found.at("curves")[1].at("uniaxial").at("nominal").back().get<double>());
}

TEST(Curves, WhatWasSeenSetsTheirExtentAndIsInThePicture) {
  Json document = preset({{"law", "neo_hookean"}, {"E", 1e5}, {"nu", 0.3}});
  document["excited"] = excitation_json({0.2, 0.05, 0.02, 1.0, 4.0});
  const Json found = curves_of_text(document.dump(), "", {}).at("material");
  EXPECT_DOUBLE_EQ(found.at("strain").get<double>(), 0.3);
  EXPECT_DOUBLE_EQ(found.at("rate").get<double>(), 2.0);
  const std::string picture = curves_picture("a < b", found);
  EXPECT_NE(picture.find("fill-opacity='.12'"), std::string::npos);
  EXPECT_NE(picture.find("a &lt; b"), std::string::npos);
  EXPECT_NE(picture.find("strains up to 0.2"), std::string::npos);
  EXPECT_EQ(picture.find("nan"), std::string::npos);
}

TEST(Curves, OfWeightsInAFile) {
  const std::filesystem::path pt =
      std::filesystem::path(MATTERFIT_DATA_DIR) / "nclaw_weights" / "sand_0300.pt";
  if (!std::filesystem::exists(pt)) GTEST_SKIP() << pt << " is not here";
  const Json found = curves_of_file(pt, {}).at("sand_0300");
  EXPECT_EQ(found.at("curves")[0].at("law"), "neural");
  EXPECT_FALSE(found.at("curves")[0].at("shear").is_null());
}

TEST(Curves, WrongOptionsAndFilesAreNamed) {
  EXPECT_THROW((void)curve_options({{"strian", 0.2}}), Error);
  EXPECT_THROW((void)curve_options({{"strain", 0.0}}), Error);
  EXPECT_THROW((void)curves_of_text("{}", "", {}), Error);
  Json document = preset({{"law", "neo_hookean"}, {"E", 1e5}, {"nu", 0.3}});
  document["excited"] = {{"strain", 0.1}, {"compression", 0}, {"expansion", 0}, {"rates", {3, 2}}};
  EXPECT_THROW((void)curves_of_text(document.dump(), "", {}), Error);
}

}  // namespace
}  // namespace matterfit::job
