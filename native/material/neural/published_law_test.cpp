// SPDX-License-Identifier: GPL-3.0-or-later
// The published law against a plain double evaluation of its definition, its gradients against
// differences of that, and the published weights' own spot values.
#include "material/neural/published_law.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <filesystem>
#include <random>
#include <vector>

#include "base/error.hpp"
#include "base/vec.hpp"
#include "material/neural/published_file.hpp"

namespace matterfit::material {
namespace {

using Row = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The definition, written plainly: singular values descending, the determinant's sign on the last,
/// clamped at 0.05; thirteen invariants; two nets with exact GELU.
struct Plain {
  std::vector<double> weights;  ///< elastic, then plastic

  explicit Plain(const PublishedWeights& from) {
    weights.assign(from.elastic.begin(), from.elastic.end());
    weights.insert(weights.end(), from.plastic.begin(), from.plastic.end());
  }

  [[nodiscard]] Mat3d output(std::size_t net, const Mat3d& f, const Vec3d& sigma) const {
    const double* w = weights.data() + net * kNetWeights;
    const Matrix w1 = Eigen::Map<const Matrix>(w, 64, 13);
    const Matrix w2 = Eigen::Map<const Matrix>(w + 832, 64, 64);
    const Matrix w3 = Eigen::Map<const Matrix>(w + 832 + 4096, 9, 64);
    Eigen::VectorXd x(13);
    const Row c = f.transpose() * f - Mat3d::Identity();
    for (int i = 0; i < 3; ++i) x[i] = sigma[i] - 1.0;
    for (int i = 0; i < 9; ++i) x[3 + i] = c.data()[i];
    x[12] = f.determinant() - 1.0;
    const auto gelu = [](double v) { return 0.5 * v * (1.0 + std::erf(v / std::sqrt(2.0))); };
    const Eigen::VectorXd h1 = (w1 * x).unaryExpr(gelu);
    const Eigen::VectorXd h2 = (w2 * h1).unaryExpr(gelu);
    const Eigen::VectorXd y = w3 * h2;
    const Row out = Eigen::Map<const Row>(y.data());
    return 0.5 * (out + out.transpose());
  }

  struct Parts {
    Mat3d f, r;
    Vec3d sigma;
  };
  static Parts decompose(const Mat3d& f) {
    const Eigen::JacobiSVD<Mat3d> svd(f, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Mat3d u = svd.matrixU();
    Mat3d v = svd.matrixV();
    Vec3d sigma = svd.singularValues();
    if (u.determinant() < 0.0) u.col(2) *= -1.0, sigma[2] *= -1.0;
    if (v.determinant() < 0.0) v.col(2) *= -1.0, sigma[2] *= -1.0;
    sigma = sigma.cwiseMax(0.05);
    return {u * sigma.asDiagonal() * v.transpose(), u * v.transpose(), sigma};
  }

  void run(const Mat3d& trial, Mat3d& elastic, Mat3d& tau) const {
    const Parts before = decompose(trial);
    elastic = before.f + 1e-3 * before.r * output(1, before.f, before.sigma);
    const Parts after = decompose(elastic);
    tau = after.r * output(0, after.f, after.sigma) * after.f.transpose();
  }
};

PublishedWeights random_weights(std::uint32_t seed, double elastic, double plastic) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  PublishedWeights out;
  const auto net = [&](double last) {
    std::vector<float> w;
    w.reserve(kNetWeights);
    for (std::size_t i = 0; i < kNetWeights; ++i) {
      const double scale = i < 832 ? 0.7 : i < 832 + 4096 ? 0.18 : last;
      w.push_back(static_cast<float>(scale * normal(random)));
    }
    return w;
  };
  out.elastic = net(elastic);
  out.plastic = net(plastic);
  return out;
}

/// Deformations of several sizes; every eighth with a singular value below the clamp, every
/// ninth inverted.
std::vector<double> deformations(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::vector<double> out;
  out.reserve(9 * count);
  for (std::size_t p = 0; p < count; ++p) {
    const double size = p % 3 == 0 ? 0.4 : p % 3 == 1 ? 0.05 : 0.001;
    Row f = Row::Identity();
    for (int i = 0; i < 9; ++i) f.data()[i] += size * uniform(random);
    if (p % 8 == 7) f *= Vec3d(1.2, 0.02, 0.9).asDiagonal();
    if (p % 9 == 8) f *= Vec3d(1.2, -0.4, 0.8).asDiagonal();
    out.insert(out.end(), f.data(), f.data() + 9);
  }
  return out;
}

Mat3d matrix_at(const std::vector<double>& all, std::size_t p) {
  return Eigen::Map<const Row>(all.data() + 9 * p);
}

template <class S>
std::vector<double> widened(const std::vector<S>& from) {
  return {from.begin(), from.end()};
}
std::vector<float> narrowed(const std::vector<double>& from) {
  std::vector<float> out;
  out.reserve(from.size());
  for (const double value : from) out.push_back(static_cast<float>(value));
  return out;
}

double largest_of(const std::vector<double>& values) {
  double most = 0.0;
  for (const double value : values) most = std::max(most, std::abs(value));
  return most;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

TEST(PublishedLaw, EqualsThePlainEvaluation) {
  Arena arena(2);
  const PublishedWeights weights = random_weights(1, 1e4, 8.0);
  const Plain plain(weights);
  const std::size_t count = 301;
  const std::vector<double> trial = deformations(count, 2);
  std::vector<double> elastic(trial.size());
  std::vector<double> tau(trial.size());
  for (std::size_t p = 0; p < count; ++p) {
    Mat3d f;
    Mat3d t;
    plain.run(matrix_at(trial, p), f, t);
    Eigen::Map<Row>(elastic.data() + 9 * p) = f;
    Eigen::Map<Row>(tau.data() + 9 * p) = t;
  }
  std::vector<double> f64(trial.size());
  std::vector<double> t64(trial.size());
  published_forward<double>(weights, GeluMode::kExact, trial, f64, t64, arena);
  EXPECT_LT(largest_difference(f64, elastic), 1e-11);
  EXPECT_LT(largest_difference(t64, tau), 1e-10 * largest_of(tau));

  const std::vector<float> trial32 = narrowed(trial);
  std::vector<float> f32(trial.size());
  std::vector<float> t32(trial.size());
  published_forward<float>(weights, GeluMode::kExact, trial32, f32, t32, arena);
  EXPECT_LT(largest_difference(widened(f32), elastic), 1e-5);
  EXPECT_LT(largest_difference(widened(t32), tau), 1e-5 * largest_of(tau));
  published_forward<float>(weights, GeluMode::kPolynomial, trial32, f32, t32, arena);
  EXPECT_LT(largest_difference(widened(f32), elastic), 1e-4);
  EXPECT_LT(largest_difference(widened(t32), tau), 1e-3 * largest_of(tau));
}

/// L = Σ F̄ : F + τ̄ : τ by the double evaluation.
struct PublishedProblem {
  PublishedWeights weights = random_weights(3, 1.0, 40.0);
  std::vector<double> trial;
  std::vector<double> elastic_bar;
  std::vector<double> tau_bar;

  explicit PublishedProblem(std::size_t count) : trial(deformations(count, 4)) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    for (std::size_t i = 0; i < trial.size(); ++i) {
      elastic_bar.push_back(uniform(random));
      tau_bar.push_back(uniform(random));
    }
  }
  [[nodiscard]] double value(GeluMode mode, Arena& arena) const {
    std::vector<double> f(trial.size());
    std::vector<double> t(trial.size());
    published_forward<double>(weights, mode, trial, f, t, arena);
    double sum = 0.0;
    for (std::size_t i = 0; i < f.size(); ++i) sum += elastic_bar[i] * f[i] + tau_bar[i] * t[i];
    return sum;
  }
};

TEST(PublishedLaw, GradientsAreThoseOfDifferences) {
  Arena arena(1);
  for (const GeluMode mode : {GeluMode::kExact, GeluMode::kPolynomial}) {
    PublishedProblem problem(24);
    std::vector<double> trial_bar(problem.trial.size());
    std::vector<double> weights_bar(2 * kNetWeights);
    published_backward<double>(problem.weights, mode, problem.trial, problem.elastic_bar,
                               problem.tau_bar, trial_bar, weights_bar, arena);
    const double scale = largest_of(trial_bar);
    for (std::size_t i = 0; i < problem.trial.size(); ++i) {
      PublishedProblem moved = problem;
      const double step = 1e-5;
      const auto at = [&](double by) {
        moved.trial[i] = problem.trial[i] + by;
        return moved.value(mode, arena);
      };
      const double slope =
          (8.0 * (at(step) - at(-step)) - (at(2 * step) - at(-2 * step))) / (12.0 * step);
      EXPECT_NEAR(trial_bar[i], slope, 1e-6 * scale) << "point " << i / 9 << " entry " << i % 9;
    }
    const double weight_scale = largest_of(weights_bar);
    for (std::size_t k = 0; k < 2 * kNetWeights; k += 331) {
      PublishedProblem moved = problem;
      float& weight =
          k < kNetWeights ? moved.weights.elastic[k] : moved.weights.plastic[k - kNetWeights];
      const float before = weight;
      const float above = before + 0.01F;
      const float below = before - 0.01F;
      weight = above;
      const double up = moved.value(mode, arena);
      weight = below;
      const double down = moved.value(mode, arena);
      const double slope = (up - down) / (static_cast<double>(above) - static_cast<double>(below));
      EXPECT_NEAR(weights_bar[k], slope, 2e-5 * weight_scale) << "weight " << k;
    }
  }
}

TEST(PublishedLaw, RegistersGiveTheGradientsOfDouble) {
  Arena arena(1);
  const PublishedProblem problem(200);
  std::vector<double> trial_bar(problem.trial.size());
  std::vector<double> weights_bar(2 * kNetWeights);
  published_backward<double>(problem.weights, GeluMode::kExact, problem.trial, problem.elastic_bar,
                             problem.tau_bar, trial_bar, weights_bar, arena);
  std::vector<float> trial_bar32(problem.trial.size());
  std::vector<double> weights_bar32(2 * kNetWeights);
  published_backward<float>(problem.weights, GeluMode::kExact, narrowed(problem.trial),
                            narrowed(problem.elastic_bar), narrowed(problem.tau_bar), trial_bar32,
                            weights_bar32, arena);
  EXPECT_LT(largest_difference(widened(trial_bar32), trial_bar), 1e-5 * largest_of(trial_bar));
  EXPECT_LT(largest_difference(weights_bar32, weights_bar), 1e-5 * largest_of(weights_bar));
}

TEST(PublishedLaw, SameBitsForAnyNumberOfThreads) {
  Arena one(1);
  Arena three(3);
  const PublishedProblem problem(3000);
  const std::vector<float> trial = narrowed(problem.trial);
  const std::vector<float> bar = narrowed(problem.tau_bar);
  const auto run = [&](Arena& arena, std::vector<float>& f_bar, std::vector<double>& w_bar) {
    published_backward<float>(problem.weights, GeluMode::kPolynomial, trial, bar, bar, f_bar, w_bar,
                              arena);
  };
  std::vector<float> f1(trial.size());
  std::vector<float> f3(trial.size());
  std::vector<double> w1(2 * kNetWeights);
  std::vector<double> w3(2 * kNetWeights);
  run(one, f1, w1);
  run(three, f3, w3);
  EXPECT_EQ(f1, f3);
  EXPECT_EQ(w1, w3);
}

TEST(PublishedLaw, WeightsThatDoNotFitAreRefused) {
  PublishedWeights weights = random_weights(1, 1.0, 1.0);
  weights.plastic.pop_back();
  EXPECT_THROW(check_published_weights(weights, "file"), Error);
  weights = random_weights(1, 1.0, 1.0);
  weights.elastic[7] = std::nanf("");
  EXPECT_THROW(check_published_weights(weights, "file"), Error);
}

/// Stress along x at a stretch along x alone.
double uniaxial(const PublishedWeights& weights, double stretch, Arena& arena) {
  const std::vector<double> trial{stretch, 0, 0, 0, 1, 0, 0, 0, 1};
  std::vector<double> elastic(9);
  std::vector<double> tau(9);
  // The elastic net alone: what is measured is its stress at this very stretch.
  PublishedWeights still = weights;
  still.plastic.assign(kNetWeights, 0.0F);
  published_forward<double>(still, GeluMode::kExact, trial, elastic, tau, arena);
  return tau[0];
}

TEST(PublishedLaw, PublishedWeightsGiveTheirSpotValues) {
  const std::filesystem::path folder = std::filesystem::path(MATTERFIT_DATA_DIR) / "nclaw_weights";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  Arena arena(1);
  const PublishedWeights jelly = read_published_pt(folder / "jelly_0300.pt");
  EXPECT_NEAR(uniaxial(jelly, 1.01, arena), 1081.0, 0.5);
  EXPECT_NEAR(uniaxial(jelly, 1.1, arena), 12047.0, 0.5);
  EXPECT_NEAR(uniaxial(jelly, 0.7, arena), -23490.0, 0.5);
  EXPECT_NEAR(uniaxial(jelly, 1.0, arena), 0.0, 1e-9);
  EXPECT_NEAR(uniaxial(read_published_pt(folder / "plasticine_0300.pt"), 1.01, arena), 4404.0, 0.5);
  EXPECT_NEAR(uniaxial(read_published_pt(folder / "sand_0300.pt"), 0.99, arena), -14279.0, 0.5);
}

}  // namespace
}  // namespace matterfit::material
