// SPDX-License-Identifier: GPL-3.0-or-later
// A law from what a testing machine measured: Treloar's rubber, beside neo-Hooke and Ogden.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <fstream>

#include "base/error.hpp"
#include "base/folder_for_test.hpp"
#include "job/curves.hpp"
#include "job/documents/tests_document.hpp"
#include "job/pretrain_files.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

fs::path treloar() {
  return fs::path(MATTERFIT_SOURCE_DIR) / "docs/examples/testing_machine/treloar.json";
}

/// μ₁, μ₂, μ₃ [Pa] and their exponents.
using Ogden = Eigen::Matrix<double, 6, 1>;

std::vector<double> nominal_of(const Ogden& law, const material::MachineTest& test) {
  const double across = test.pull == material::Pull::kUniaxial ? 0.5 : 2.0;
  std::vector<double> all;
  for (const double by : test.by) {
    double stress = 0.0;
    for (int i = 0; i < 3; ++i) {
      stress +=
          law[i] * (std::pow(by, law[3 + i] - 1.0) - std::pow(by, -across * law[3 + i] - 1.0));
    }
    all.push_back(stress);
  }
  return all;
}

/// Ogden's terms of least error by the sizes that the neural law's are counted by.
Ogden fitted_ogden(const Ogden& start, const material::MachineTest& test) {
  double mean = 0.0;
  for (const double stress : test.nominal) mean += std::abs(stress) / double(test.nominal.size());
  const auto rows = static_cast<Eigen::Index>(test.by.size());
  const auto residual = [&](const Ogden& law) {
    const std::vector<double> found = nominal_of(law, test);
    Eigen::VectorXd out(rows);
    for (Eigen::Index k = 0; k < rows; ++k) {
      const auto at = static_cast<std::size_t>(k);
      out[k] = (found[at] - test.nominal[at]) / (test.nominal[at] + 0.5 * mean);
    }
    return out;
  };
  Ogden law = start;
  Eigen::VectorXd at = residual(law);
  double damping = 1e-2;
  for (int step = 0; step < 2000 && damping < 1e10; ++step) {
    Eigen::MatrixXd jacobian(rows, 6);
    for (int k = 0; k < 6; ++k) {
      Ogden moved = law;
      const double by = 1e-6 * std::abs(law[k]);
      moved[k] += by;
      jacobian.col(k) = (residual(moved) - at) / by;
    }
    Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
    normal.diagonal() *= 1.0 + damping;
    const Ogden trial = law - Ogden(normal.ldlt().solve(jacobian.transpose() * at));
    const Eigen::VectorXd there = residual(trial);
    if (there.allFinite() && there.squaredNorm() < at.squaredNorm()) {
      law = trial;
      at = there;
      damping = std::max(0.3 * damping, 1e-12);
    } else {
      damping *= 4.0;
    }
  }
  return law;
}

TEST(PretrainTests, TreloarsRubberIsFollowedAndItsOtherTestPredicted) {
  const Folder folder;
  PretrainOptions options;
  options.folder = folder.path;
  options.tests = {treloar()};
  const Json report = write_start_laws(options).at("treloar");
  const Json& pulled = report.at("fitted")[0];
  const Json& two_ways = report.at("held_out")[0];
  EXPECT_GE(pulled.at("r_squared").get<double>(), 0.999);
  // What the uniaxial test alone says of two axes: at least what a neo-Hookean of it does.
  EXPECT_GE(two_ways.at("r_squared").get<double>(),
            two_ways.at("neo_hookean").get<double>() - 0.005);
  EXPECT_EQ(report.size(), 4U);

  const TestsDoc doc = read_tests_file(treloar());
  Ogden published;  // Ogden, Proc. R. Soc. A 326 (1972), of all three tests
  published << 6.3e5, 1.2e3, -1e4, 1.3, 5.0, -2.0;
  const Ogden alone = fitted_ogden(published, doc.fitted[0]);
  const auto agrees = [&](const Ogden& law, const material::MachineTest& test) {
    return material::r_squared(nominal_of(law, test), test.nominal);
  };
  RecordProperty("ours_uniaxial", pulled.at("r_squared").dump());
  RecordProperty("ours_equibiaxial", two_ways.at("r_squared").dump());
  RecordProperty("neo_hookean_uniaxial", pulled.at("neo_hookean").dump());
  RecordProperty("neo_hookean_equibiaxial", two_ways.at("neo_hookean").dump());
  RecordProperty("ogden_uniaxial", std::to_string(agrees(alone, doc.fitted[0])));
  RecordProperty("ogden_equibiaxial", std::to_string(agrees(alone, doc.held_out[0])));
  RecordProperty("ogden_of_all_uniaxial", std::to_string(agrees(published, doc.fitted[0])));
  RecordProperty("ogden_of_all_equibiaxial", std::to_string(agrees(published, doc.held_out[0])));

  // The weights are a law like any other.
  CurveOptions curves;
  curves.beside = false;
  curves.strain = 2.0;
  const Json found = curves_of_file(folder.path / "treloar.safetensors", curves).at("treloar");
  EXPECT_EQ(found.at("faults").size(), 0U);
  EXPECT_EQ(found.at("curves")[0].at("law"), "neural_isotropic");
}

TEST(PretrainTests, AFileThatIsNoneIsNamed) {
  const Folder folder;
  const auto refuses = [&](const std::string& text, const std::string& words) {
    const fs::path file = folder.path / "tests.json";
    std::ofstream(file) << text;
    try {
      (void)read_tests_file(file);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  const std::string head = R"({"schema": "matterfit.tests/1", "name": "x", "tests": )";
  refuses(R"({"schema": "matterfit.job/1"})", "schema");
  refuses(head + "[]}", "each test is held out");
  refuses(head + R"([{"pull": "twist", "by": [1], "nominal": [0]}]})", "tests[0].pull");
  refuses(head + R"([{"pull": "uniaxial", "by": [1, 2], "nominal": [0]}]})", "not as long");
  refuses(head + R"([{"pull": "uniaxial", "by": [2], "nominal": [1], "held": true}]})", "held");
}

}  // namespace
}  // namespace matterfit::job
