// SPDX-License-Identifier: GPL-3.0-or-later
// What a testing machine measured, with something hidden in it.
#include "job/diagnosis/diagnose_tests.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/folder_for_test.hpp"
#include "effects/effect.hpp"
#include "effects/effect_type.hpp"
#include "effects/term.hpp"
#include "job/diagnosis/page.hpp"
#include "job/diagnosis/tests_model.hpp"
#include "material/stress_curves.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

constexpr double kModulus = 1.2e6;
constexpr double kPoisson = 0.4995;
constexpr double kReadingError = 0.01;

struct HiddenInTests {
  std::vector<effects::Effect> effects = {};
  double cell = 1.0;          ///< read over true force of the first test
  double zero = 0.0;          ///< what its cell reads without force [Pa]
  double gauge = 1.0;         ///< true over read elongation
  double poisson = kPoisson;  ///< of the rubber; the document says kPoisson
};

effects::Effect effect_of(const char* type, std::vector<double> values) {
  effects::Effect effect = effects::make_effect(type);
  effect.values = std::move(values);
  return effect;
}

/// A neo-Hookean rubber pulled along one axis and along two, read with noise.
Json machine_tests(const HiddenInTests& hidden, std::uint64_t seed) {
  material::Material material;
  material.law = material::Law::kNeoHookean;
  material.youngs_modulus = kModulus;
  material.poisson_ratio = hidden.poisson;
  std::vector<std::unique_ptr<effects::Term>> terms;
  for (const effects::Effect& effect : hidden.effects) {
    terms.push_back(effect.type->make(effect, {}));
  }
  const material::FurtherStress further = [&](const Mat3d& elastic) {
    effects::MaterialPoint point;
    point.deformation_gradient = elastic;
    Mat3d sum = Mat3d::Zero();
    for (const auto& term : terms) sum += term->stress(point, {});
    return sum;
  };
  std::mt19937_64 random(seed);
  std::normal_distribution<double> error(0.0, kReadingError);
  Json tests = Json::array();
  for (const material::Pull pull : {material::Pull::kUniaxial, material::Pull::kEquibiaxial}) {
    std::vector<double> by;
    std::vector<double> stops;
    for (int k = 1; k <= 24; ++k) {
      by.push_back(1.0 + 0.1 * k);
      stops.push_back(1.0 + hidden.gauge * 0.1 * k);
    }
    Json read = Json::array();
    const double cell = tests.empty() ? hidden.cell : 1.0;
    const double zero = tests.empty() ? hidden.zero : 0.0;
    for (const auto& point : material::stress_curve(material, pull, stops, 1.0, further)) {
      read.push_back((cell * point.nominal + zero) * (1.0 + error(random)));
    }
    tests.push_back({{"pull", material::pull_name(pull)}, {"by", by}, {"nominal", read}});
  }
  return {{"schema", "matterfit.tests/1"},
          {"name", "rubber"},
          {"poisson_ratio", kPoisson},
          {"noise", kReadingError},
          {"tests", tests}};
}

Json diagnosed(const Json& tests, int threads = 1) {
  const Folder folder;
  const fs::path file = folder.path / "tests.json";
  std::ofstream(file) << tests.dump();
  Interrupter interrupter;
  return diagnose_tests(file, threads, interrupter);
}

std::vector<std::string> classes_of(const Json& report) {
  return report.at("class").get<std::vector<std::string>>();
}

TEST(DiagnoseTests, NothingHiddenIsNothing) {
  int named = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U, 6U}) {
    named += diagnosed(machine_tests({}, seed)).at("verdict") == "nothing" ? 0 : 1;
  }
  EXPECT_LE(named, 1);
}

TEST(DiagnoseTests, AStiffeningIsNamedWithItsSize) {
  const double first = 4.0e4;  // [Pa] of Ī₁ − 3
  const Json report =
      diagnosed(machine_tests({.effects = {effect_of("strain_stiffening", {first, 1.0})}}, 7));
  EXPECT_EQ(report.at("verdict"), "cause") << report.at("sentence");
  EXPECT_THAT(classes_of(report), ::testing::ElementsAre("strain_stiffening"));
  EXPECT_GT(report.at("causes")[0].at("gain").get<double>(), 0.8);
  // The extended model's terms together at the farthest stretch.
  const double most = 2.0 * 3.4 * 3.4 + std::pow(3.4, -4.0) - 3.0;
  double sum = 0.0;
  for (const Json& effect : report.at("model").at("effects")) {
    sum += effect.at("modulus").get<double>() * std::pow(most, effect.at("exponent").get<double>());
  }
  EXPECT_NEAR(sum, first * most, 0.1 * first * most);
}

TEST(DiagnoseTests, MooneysTermIsNamedWhereTwoAxesArePulledToo) {
  const Json report =
      diagnosed(machine_tests({.effects = {effect_of("second_invariant", {1.0e5})}}, 8));
  EXPECT_EQ(report.at("verdict"), "cause") << report.at("sentence");
  EXPECT_THAT(classes_of(report), ::testing::ElementsAre("second_invariant"));
  const Json& effect = report.at("model").at("effects")[0];
  EXPECT_NEAR(effect.at("modulus").get<double>(), 1.0e5, 1.5e4);
}

TEST(DiagnoseTests, FibresAlongThePullAreNamed) {
  const Json report =
      diagnosed(machine_tests({.effects = {effect_of("fibres", {1.0, 0.0, 0.0, 4.0e5})}}, 10));
  EXPECT_EQ(report.at("verdict"), "cause") << report.at("sentence");
  EXPECT_THAT(classes_of(report), ::testing::ElementsAre("fibres"));
  const Json& effect = report.at("model").at("effects")[0];
  EXPECT_EQ(effect.at("direction"), Json({1.0, 0.0, 0.0}));
  EXPECT_NEAR(effect.at("modulus").get<double>(), 4.0e5, 6.0e4);
}

TEST(DiagnoseTests, AVolumeThatGivesWayIsNamed) {
  const Json report = diagnosed(machine_tests({.poisson = 0.35}, 11));
  EXPECT_EQ(report.at("verdict"), "cause") << report.at("sentence");
  EXPECT_THAT(classes_of(report), ::testing::ElementsAre("poisson_ratio"));
  EXPECT_NEAR(report.at("model").at("material").at("nu").get<double>(), 0.35, 0.03);
}

TEST(DiagnoseTests, ElongationsThatAreReadWrongAreTheMeasurement) {
  const Json report = diagnosed(machine_tests({.gauge = 1.25}, 12));
  EXPECT_EQ(report.at("verdict"), "measurement") << report.at("sentence");
  EXPECT_THAT(classes_of(report), ::testing::ElementsAre("gauge_length"));
  const Json& share = report.at("causes")[0].at("parameters").at("share");
  EXPECT_NEAR(share.at("value").get<double>(), 0.25, 0.1);
}

TEST(DiagnoseTests, ALoadCellThatDoesNotReadZeroIsTheMeasurement) {
  const Json report = diagnosed(machine_tests({.zero = 1.0e5}, 13));
  EXPECT_EQ(report.at("verdict"), "measurement") << report.at("sentence");
  EXPECT_THAT(classes_of(report), ::testing::ElementsAre("load_zero"));
  const Json& cause = report.at("causes")[0];
  EXPECT_EQ(cause.at("scope"), "capture uniaxial");
  EXPECT_NEAR(cause.at("parameters").at("stress").at("value").get<double>(), 1.0e5, 1.5e4);
}

TEST(DiagnoseTests, ALoadCellThatReadsTooMuchIsTheMeasurement) {
  const Json report = diagnosed(machine_tests({.cell = 1.15}, 9));
  EXPECT_EQ(report.at("verdict"), "measurement") << report.at("sentence");
  EXPECT_THAT(classes_of(report), ::testing::ElementsAre("load_cell"));
}

TEST(DiagnoseTests, TreloarsRubberStiffens) {
  const fs::path folder = fs::path(MATTERFIT_SOURCE_DIR) / "docs/examples/testing_machine";
  Interrupter interrupter;
  const Json pulled = diagnose_tests(folder / "treloar_pulled.json", 1, interrupter);
  EXPECT_EQ(pulled.at("verdict"), "cause") << pulled.at("sentence");
  EXPECT_THAT(classes_of(pulled), ::testing::ElementsAre("strain_stiffening"));
  EXPECT_GT(pulled.at("causes")[0].at("gain_interval")[0].get<double>(), 0.5);
  // In shares of a stress, in the page too.
  EXPECT_EQ(pulled.at("shown").at("unit"), "%");
  EXPECT_EQ(report_page(pulled).find(" mm"), std::string::npos);
  // What one axis says of two is no better than without it, and that is said.
  const Json both = diagnose_tests(folder / "treloar.json", 1, interrupter);
  EXPECT_EQ(both.at("verdict"), "unknown");
  EXPECT_THAT(both.at("sentence").get<std::string>(), ::testing::HasSubstr("gets worse with it"));
}

/// Tests that could be made reach as far as those that were, by their strain.
TEST(DiagnoseTests, FurtherTestsReachAsFar) {
  Json tests = machine_tests({}, 1);
  tests["tests"].erase(1);
  const Folder folder;
  std::ofstream(folder.path / "tests.json") << tests.dump();
  const Interrupter interrupter;
  const TestsModel model(read_tests_file(folder.path / "tests.json"), 1, interrupter);
  ASSERT_EQ(model.experiments().size(), 2U);
  EXPECT_EQ(model.experiments()[0].name, "equibiaxial test");
  EXPECT_EQ(model.experiments()[1].name, "shear test");
  diagnose::Point point;
  point.theta = Eigen::VectorXd::Constant(1, std::log(kModulus));
  const double strain = material::pull_strain(material::Pull::kUniaxial, 3.4);
  const double stretch = material::pull_at(material::Pull::kEquibiaxial, strain);
  const auto motion = model.simulate_experiment(0, {point});
  ASSERT_TRUE(motion[0]);
  // P = G (λ − λ⁻⁵), in shares of the largest stress and half of the mean.
  double mean = 0.0;
  for (const Json& stress : tests["tests"][0]["nominal"]) mean += stress.get<double>() / 24.0;
  const double unit = tests["tests"][0]["nominal"].back().get<double>() + 0.5 * mean;
  const double shear = kModulus / (2.0 * (1.0 + kPoisson));
  const auto last = motion[0]->positions.size() - 3;
  EXPECT_NEAR(motion[0]->positions[last] * unit, shear * (stretch - std::pow(stretch, -5.0)),
              0.01 * shear * stretch);
}

TEST(DiagnoseTests, TheOrderOfReadingsAndThreadsDoNotMatter) {
  const Json tests = machine_tests({.effects = {effect_of("strain_stiffening", {4.0e4, 1.0})}}, 7);
  Json turned = tests;
  for (Json& test : turned["tests"]) {
    std::reverse(test["by"].begin(), test["by"].end());
    std::reverse(test["nominal"].begin(), test["nominal"].end());
  }
  EXPECT_EQ(diagnosed(tests), diagnosed(turned));
  EXPECT_EQ(diagnosed(tests), diagnosed(tests, 4));
}

TEST(DiagnoseTests, ReadingsThatCannotBeAreRefusedWithTheirPlace) {
  const auto refuses = [](const std::function<void(Json&)>& spoil, const std::string& words) {
    Json tests = machine_tests({}, 1);
    spoil(tests["tests"][1]);
    try {
      (void)diagnosed(tests);
      ADD_FAILURE() << words;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      EXPECT_THAT(error.what(), ::testing::HasSubstr(words));
      EXPECT_THAT(error.what(), ::testing::HasSubstr("tests"));
    }
  };
  refuses([](Json& test) { test["by"][3] = -1.0; }, "tests[1]: 'by' has a stretch");
  refuses([](Json& test) { test["nominal"] = std::vector<double>(24, 0.0); },
          "tests[1]: all of 'nominal' are 0");
  refuses(
      [](Json& test) {
        test["by"] = std::vector<double>(3000, 1.1);
        test["nominal"] = std::vector<double>(3000, 1e4);
      },
      "3000 readings");
  refuses(
      [](Json& test) {
        test["by"] = {1.1, 1.2};
        test["nominal"] = {1e4, 2e4};
        test["held_out"] = true;
      },
      "the equibiaxial test has 2 readings");
}

}  // namespace
}  // namespace matterfit::job
