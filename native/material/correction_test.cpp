// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/correction.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>
#include <vector>

#include "base/message_for_test.hpp"

namespace matterfit::material {
namespace {

using testing::HasSubstr;

Material jelly(std::vector<double> correction) {
  Material material;
  material.law = Law::kNeoHookean;
  material.youngs_modulus = 2.0;
  material.poisson_ratio = 0.3;
  material.correction = std::move(correction);
  return material;
}

const std::vector<double> kLoud = {0.7, -0.2, 3.0, 0.2, 0.6};

Mat3d random_matrix(std::mt19937_64& generator, double size) {
  std::normal_distribution<double> normal(0.0, size);
  Mat3d m;
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = normal(generator);
  return m;
}

Mat3d random_rotation(std::mt19937_64& generator) {
  const Eigen::HouseholderQR<Mat3d> qr(random_matrix(generator, 1.0));
  Mat3d q = qr.householderQ();
  if (q.determinant() < 0.0) q.col(0) *= -1.0;
  return q;
}

double dot(const Mat3d& a, const Mat3d& b) { return (a.array() * b.array()).sum(); }

/// Fourth-order difference of a function of one number.
template <class F>
double difference(const F& f, double step) {
  return (8.0 * (f(step) - f(-step)) - (f(2.0 * step) - f(-2.0 * step))) / (12.0 * step);
}

TEST(Correction, IsTheDerivativeOfItsEnergy) {
  std::mt19937_64 generator(3);
  const Correction correction(jelly(kLoud));
  for (int k = 0; k < 20; ++k) {
    const Mat3d f = Mat3d::Identity() + random_matrix(generator, 0.25);
    const Mat3d rate = random_matrix(generator, 1.0);
    // Ẇ = τ : ∇v.
    const double found = dot(correction.stress(f), rate);
    const double expected =
        difference([&](double by) { return correction.energy(f + by * rate * f); }, 1e-4);
    EXPECT_NEAR(found, expected, 1e-8);
  }
}

TEST(Correction, IsIsotropicAndDoesNotFeelRotations) {
  std::mt19937_64 generator(4);
  const Correction correction(jelly(kLoud));
  for (int k = 0; k < 5; ++k) {
    const Mat3d f = Mat3d::Identity() + random_matrix(generator, 0.3);
    const Mat3d q = random_rotation(generator);
    const Mat3d tau = correction.stress(f);
    EXPECT_LT((correction.stress(q * f) - q * tau * q.transpose()).norm(), 1e-12);
    EXPECT_LT((correction.stress(f * q) - tau).norm(), 1e-12);
  }
}

TEST(Correction, HasNeitherStressNorStiffnessAtRest) {
  std::mt19937_64 generator(5);
  const Correction correction(jelly(kLoud));
  EXPECT_EQ(correction.stress(Mat3d::Identity()), Mat3d::Zero());
  const Mat3d way = random_matrix(generator, 1.0);
  const auto stress = [&](double size) {
    return correction.stress(Mat3d::Identity() + size * way).norm();
  };
  EXPECT_LT(stress(1e-4), 1e-5 * 1e-4 * 200.0);
  EXPECT_NEAR(stress(2e-4) / stress(1e-4), 4.0, 0.1) << "of second order, by the asymmetry";
}

TEST(Correction, HasItsAdjoint) {
  std::mt19937_64 generator(6);
  for (int k = 0; k < 20; ++k) {
    const Material material = jelly(kLoud);
    const Correction correction(material);
    Mat3d f = Mat3d::Identity() + random_matrix(generator, 0.25);
    // Stretches that are equal, or nearly.
    if (k == 0) f = 1.2 * Mat3d::Identity();
    if (k == 1) f = Vec3d(1.2, 1.2 + 1e-9, 0.8).asDiagonal();
    const Mat3d bar = random_matrix(generator, 1.0);
    Mat3d f_bar = Mat3d::Zero();
    std::vector<double> numbers(kCorrectionSize, 0.0);
    correction.stress_adjoint(f, bar, f_bar, numbers.data());
    const Mat3d way = random_matrix(generator, 1.0);
    const double expected =
        difference([&](double by) { return dot(bar, correction.stress(f + by * way)); }, 1e-4);
    EXPECT_NEAR(dot(f_bar, way), expected, 1e-7 * std::max(1.0, std::abs(expected))) << k;
    for (std::size_t i = 0; i < kCorrectionSize; ++i) {
      const double by_number = difference(
          [&](double by) {
            Material moved = material;
            moved.correction[i] += by;
            return dot(bar, Correction(moved).stress(f));
          },
          0.1);
      EXPECT_NEAR(numbers[i], by_number, 1e-10) << i;
    }
  }
}

/// The stiffness in Hencky strains against that of μ |dev H|² + ½ K (tr H)², at many strains: the
/// eigenvalue farthest from 0 either way.
std::array<double, 2> curvature(const std::vector<double>& numbers) {
  const Material material = jelly(numbers);
  const Correction correction(material);
  const double shear = 2.0 / 2.6;
  const double bulk = 2.0 / 1.2;
  std::array<double, 2> range = {0.0, 0.0};
  std::mt19937_64 generator(7);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 4000; ++k) {
    const double size = std::exp(std::uniform_real_distribution<double>(-4.0, 1.0)(generator));
    const Vec3d h = size * Vec3d(normal(generator), normal(generator), normal(generator));
    const auto tau = [&](const Vec3d& at) -> Vec3d {
      const Vec3d stretch = at.array().exp();
      return correction.stress(stretch.asDiagonal()).diagonal();
    };
    Mat3d stiffness;
    for (int c = 0; c < 3; ++c) {
      const Vec3d by = 1e-5 * Vec3d::Unit(c);
      stiffness.col(c) = (tau(h + by) - tau(h - by)) / 2e-5;
    }
    const Mat3d volume = Mat3d::Constant(1.0 / 3.0);
    const Mat3d own = 2.0 * shear * (Mat3d::Identity() - volume) + 3.0 * bulk * volume;
    const Mat3d symmetric = 0.5 * (stiffness + stiffness.transpose());
    const Eigen::GeneralizedSelfAdjointEigenSolver<Mat3d> solver(symmetric, own);
    range[0] = std::min(range[0], solver.eigenvalues().minCoeff());
    range[1] = std::max(range[1], solver.eigenvalues().maxCoeff());
  }
  return range;
}

TEST(Correction, TakesNoMoreStiffnessThanIsAllowedAndAddsNoMoreThanItsBound) {
  // The worst that is allowed keeps a tenth.
  EXPECT_GE(curvature({-0.2, -0.2, -0.2, 0.0, -0.72})[0], -0.9001);
  EXPECT_LT(curvature({-0.2, -0.2, -0.2, 0.0, -0.72})[0], -0.85);
  EXPECT_GE(curvature({0.0, 0.0, 0.0, 0.6, 0.0})[0], -0.9);
  EXPECT_LT(curvature({0.0, 0.0, 0.0, 0.6, 0.0})[0], -0.75);
  const Material material = jelly({0.0, 4.0, 0.0, 0.0, 4.0});
  const double bound = Correction(material).modulus_bound();
  const double most = curvature(material.correction)[1];
  EXPECT_GT(most, 4.9);
  EXPECT_GT(bound, most * material.p_wave_modulus());
}

TEST(Correction, OfCrushedAndInvertedPointsIsFinite) {
  const Correction correction(jelly({20.0, 10.0, 30.0, 0.3, 30.0}));
  for (const Vec3d& stretch :
       {Vec3d(1.0, 1.0, 0.0), Vec3d(0.0, 0.0, 0.0), Vec3d(1.0, 1.0, -0.5), Vec3d(1e6, 1.0, 1e-9)}) {
    const Mat3d f = stretch.asDiagonal();
    EXPECT_TRUE(correction.stress(f).allFinite()) << stretch.transpose();
    Mat3d bar = Mat3d::Zero();
    std::vector<double> numbers(kCorrectionSize, 0.0);
    correction.stress_adjoint(f, Mat3d::Ones(), bar, numbers.data());
    EXPECT_TRUE(bar.allFinite()) << stretch.transpose();
  }
}

TEST(Correction, OfAFluidIsAPressure) {
  Material water;
  water.law = Law::kNewtonian;
  water.bulk_modulus = 1e3;
  water.correction = {5.0, 5.0, 5.0, 0.2, 1.0};
  const Mat3d f = Vec3d(0.9, 1.0, 0.95).asDiagonal();
  const Mat3d tau = Correction(water).stress(f);
  EXPECT_LT(tau(0, 0), -10.0);
  EXPECT_LT((tau - tau(0, 0) * Mat3d::Identity()).norm(), 1e-10);
}

TEST(Correction, IsChecked) {
  const auto refusal = [](std::vector<double> numbers) {
    return message_of([&] { validate(jelly(numbers), "material"); });
  };
  EXPECT_THAT(refusal({1.0}), HasSubstr("material.correction has 1 numbers; a correction has 5"));
  EXPECT_THAT(refusal({0.0, 60.0, 0.0, 0.0, 0.0}), HasSubstr("material.correction[1] = 60"));
  EXPECT_THAT(refusal({0.0, 0.0, 0.0, 0.0, std::nan("")}), HasSubstr("material.correction[4]"));
  EXPECT_THAT(refusal({-0.3, -0.3, 0.0, 0.2, 0.0}), HasSubstr("of a stiffness away"));
  EXPECT_NO_THROW(validate(jelly({-0.3, 0.0, 0.0, 0.3, -0.6}), "material"));
}

}  // namespace
}  // namespace matterfit::material
